"""The extension of Sphinx: it writes the pages of the catalogue, prepares docstrings and formulas,
adds the report.
"""

import os
import re
import shutil
import sys
from collections.abc import Sequence
from copy import copy
from html import escape
from pathlib import Path
from textwrap import shorten
from typing import Any

from docutils import nodes
from myst_nb.core import render
from nbformat import NotebookNode
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.environment import BuildEnvironment
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from site_pages import docstrings
from site_pages.pages import write_pages

_LONG = 8
"""Number of rows up to which a table on a page of results is open."""
_READ = ("tutorials", "how", "guide", "reference", "api", "metrics")
"""Pages and folders of pages without results."""
_GROUPS = 6
"""Number of groups into which the pages are dealt out, about as many as Sphinx makes for two
processes."""
_NO_REPORT = (
    "The report of the leaderboard is missing: make benchmark writes it, and "
    "roletrust-results.tar.gz of a release, "
    "unpacked in the checkout, has it."
)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register all parts of the extension; Sphinx calls this."""
    app.add_directive("mermaid", Arrows)
    app.add_html_math_renderer(
        "mathml",
        inline_renderers=(docstrings.inline, None),
        block_renderers=(docstrings.block, None),
    )
    render.coalesce_streams = whole_streams
    app.connect(
        "config-inited", _begin, priority=700
    )  # before Sphinx checks that the static folders exist
    app.connect("env-before-read-docs", _deal_out)
    app.connect("autodoc-process-docstring", docstrings.readable, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", docstrings.as_written)
    app.connect("autodoc-skip-member", docstrings.skipped)
    app.connect("missing-reference", docstrings.found_by_its_last_names)
    app.connect("doctree-resolved", fold_tables)
    app.connect("build-finished", _add_report)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


class Arrows(SphinxDirective):
    """Show a flowchart of Mermaid, which would have to be fetched, as a table of its arrows by
    their start.
    """

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return the table. See `docutils.parsers.rst.Directive.run`."""
        found: dict[str, list[str]] = {}
        for start, end in re.findall(
            r"^ *(\S+) --> (\S+)$", "\n".join(self.content), flags=re.MULTILINE
        ):
            found.setdefault(start, []).append(end)
        rows = [
            f"| `{start}` | {', '.join(f'`{end}`' for end in ends)} |"
            for start, ends in found.items()
        ]
        return self.parse_text_to_nodes(
            "\n".join(["| folder | imports from |", "| --- | --- |", *rows])
        )


def whole_streams(outputs: Sequence[NotebookNode]) -> list[NotebookNode]:
    """Return the outputs of a cell with each stream in one piece.

    Programs print in pieces that end anywhere; the function of MyST-NB breaks the line after each
    piece.
    """
    found: list[NotebookNode] = []
    streams: dict[str, NotebookNode] = {}
    for output in outputs:
        if output["output_type"] != "stream":
            found.append(output)
        elif output["name"] in streams:
            streams[output["name"]]["text"] += output["text"]
        else:
            streams[output["name"]] = copy(output)
            found.append(streams[output["name"]])
    return found


def fold_tables(app: Sphinx, page: nodes.document, name: str) -> None:
    """Fold the long tables of pages of results: a reader wants the picture and the sentences
    first.
    """
    if name.partition("/")[0] in _READ:
        return
    for table in list(page.findall(nodes.table)):
        rows = len(list(next(table.findall(nodes.tbody)).findall(nodes.row)))
        if rows > _LONG:
            columns = ", ".join(entry.astext() for entry in next(table.findall(nodes.row)))
            about = escape(shorten(f"Table of {rows} rows: {columns}", 90, placeholder=" ..."))
            box = (
                table.parent if isinstance(table.parent, nodes.container) else table
            )  # of the theme
            at = box.parent.index(box)
            box.parent.insert(at + 1, nodes.raw("", "</details>", format="html"))
            box.parent.insert(
                at, nodes.raw("", f"<details><summary>{about}</summary>", format="html")
            )


def _begin(app: Sphinx, config: Config) -> None:
    # Tutorials call `roletrust` of the environment that builds the site, also if it is not
    # activated.
    os.environ["PATH"] = os.pathsep.join(
        [str(Path(sys.executable).parent), os.environ.get("PATH", "")]
    )
    os.environ |= {"COLUMNS": "100", "TTY_COMPATIBLE": "0"}  # wide tables without colours
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # two tutorials run at once
    write_pages(Path(app.srcdir) / "reference")


def _deal_out(app: Sphinx, env: BuildEnvironment, docnames: list[str]) -> None:
    # Tutorials take minutes, and a process reads pages that follow each other: in this order, each
    # process has some.
    docnames[:] = [name for first in range(_GROUPS) for name in docnames[first::_GROUPS]]


def _add_report(app: Sphinx, error: Exception | None) -> None:
    # The report is a page of its own with files beside it, so it is copied as it is.
    folder = Path("leaderboards", "standard")
    if (Path(app.srcdir) / folder / "report.html").is_file():
        shutil.copytree(Path(app.srcdir) / folder, app.outdir / folder, dirs_exist_ok=True)
        return
    (app.outdir / folder).mkdir(parents=True, exist_ok=True)
    # no browser asks for an icon
    head = '<!doctype html><title>No report</title><link rel="icon" href="data:,">'
    (app.outdir / folder / "report.html").write_text(f"{head}<p>{_NO_REPORT}", "utf-8")
    logging.getLogger(__name__).info(_NO_REPORT)
