"""The extension of Sphinx: it writes the pages of the catalogue, prepares docstrings and formulas, and adds reports."""

import os
import shutil
import sys
from pathlib import Path
from typing import Any

from myst_nb.core import render
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.util import logging

from roletrust_experiments.site import docstrings, formulas
from roletrust_experiments.site.arrows import Arrows
from roletrust_experiments.site.pages import write_pages
from roletrust_experiments.site.streams import whole_streams

_NO_REPORT = (
    "The report of the leaderboard is missing: make benchmark writes it, and roletrust-results.tar.gz of a release, "
    "unpacked in the checkout, has it."
)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register all parts of the extension; Sphinx calls this.

    The setting `site_quick` makes the same pages with pictures of shorter games, for tests.
    """
    app.add_directive("mermaid", Arrows)
    formulas.setup(app)
    render.coalesce_streams = whole_streams
    app.add_config_value("site_quick", False, "env", (bool,))
    app.connect("config-inited", _begin, priority=700)  # before Sphinx checks that the static folders exist
    app.connect("autodoc-process-docstring", docstrings.readable, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", docstrings.as_written)
    app.connect("autodoc-skip-member", docstrings.skipped)
    app.connect("missing-reference", docstrings.found_by_its_last_names)
    app.connect("build-finished", _add_reports)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _begin(app: Sphinx, config: Config) -> None:
    # Tutorials call `roletrust` of the environment that builds the site, also if it is not activated.
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    os.environ |= {"COLUMNS": "100", "TTY_COMPATIBLE": "0"}  # wide tables without colours
    write_pages(Path(app.srcdir) / "reference", quick=config.site_quick)


def _add_reports(app: Sphinx, error: Exception | None) -> None:
    # A report is a page of its own with files beside it, so it is copied as it is.
    source = Path(app.srcdir)
    folder = Path("leaderboards", "standard")
    if (source / folder / "report.html").is_file():
        shutil.copytree(source / folder, app.outdir / folder, dirs_exist_ok=True)
        return
    (app.outdir / folder).mkdir(parents=True, exist_ok=True)
    (app.outdir / folder / "report.html").write_text(f"<!doctype html><title>No report</title><p>{_NO_REPORT}", "utf-8")
    logging.getLogger(__name__).info(_NO_REPORT)
