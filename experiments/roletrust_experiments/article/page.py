"""The report as one HTML page: the template, filled with results, figures and references."""

import base64
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from pybtex.database import BibliographyData, parse_string
from pybtex.exceptions import PybtexError

from roletrust_env import __version__
from roletrust_experiments.article.results import Results, read_text


def page(folder: Path) -> str:
    """Return the page, which needs no other file and no network.

    Args:
        folder: Folder with the results, the figures and `references.bib`: `docs` of the repository.

    Raises:
        ValueError: A number, a sentence or a source that the template names is not there.
        OSError: A file is missing.
    """
    environment = Environment(
        loader=PackageLoader("roletrust_experiments.article", "template"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    results, sources = Results(folder), Sources(folder / "references.bib")
    names: dict[str, Any] = {
        **{name: getattr(results, name) for name in ("rows", "row", "first", "mark", "number", "mean", "interval")},
        **{name: getattr(results, name) for name in ("answer", "breaking", "fact", "falling")},
        "cite": sources.cite,
        "references": sources.listed,
        "picture": lambda path: _picture(folder / path),
        "version": __version__,
    }
    return environment.get_template("article.html").render(**names)


class Sources:
    """The sources that a text cites, numbered in the order of their first citation.

    Args:
        path: BibTeX file.
    """

    def __init__(self, path: Path) -> None:
        text = read_text(path)
        try:
            self._entries = parse_string(text, "bibtex").entries
        except PybtexError as error:
            raise ValueError(f"{path} is no BibTeX: {error}") from None
        self._cited: dict[str, int] = {}

    def cite(self, *keys: str) -> Markup:
        """Return the citation of some sources.

        Raises:
            ValueError: The bibliography has no such key.
        """
        links = []
        for key in keys:
            if key not in self._entries:
                raise ValueError(f"references.bib has no {key!r}")
            number = self._cited.setdefault(key, len(self._cited) + 1)
            links.append(Markup('<a href="#{}">{}</a>').format(key, number))
        return Markup('<span class="cite">[{}]</span>').format(Markup(", ").join(links))

    def listed(self) -> Markup:
        """Return the list of the sources that have been cited so far."""
        from pybtex.plugin import find_plugin

        style = find_plugin("pybtex.style.formatting", "plain")()
        html = find_plugin("pybtex.backends", "html")()
        data = BibliographyData({key: self._entries[key] for key in self._cited})
        written = {one.key: one.text.render(html) for one in style.format_bibliography(data)}
        items = (Markup('<li id="{}">{}</li>').format(key, Markup(written[key])) for key in self._cited)
        return Markup('<ol class="references">{}</ol>').format(Markup("\n").join(items))


def _picture(path: Path) -> str:
    """Return a PNG as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode("ascii")
