"""Write the technical report: `python docs/_ext/article.py docs build/report`.

Its text is `article.html` beside this file. Every number and many sentences come from the results
in `docs/`.
"""

import base64
import csv
import re
import shutil
import subprocess
import sys
import tempfile
from functools import cache, partial
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from pybtex.database import BibliographyData, parse_string
from pybtex.plugin import find_plugin

from roletrust_env import __version__
from roletrust_env.storage.files import replacing, write_text

FILES = {
    "leaderboard": "leaderboards/standard/leaderboard.csv",
    "conditions": "leaderboards/standard/conditions.csv",
    "moved": "leaderboards/standard/moved.csv",
    "worlds": "leaderboards/standard/worlds.csv",
    "real": "real/real.csv",
    "strategic": "strategic/strategic.csv",
    "panel": "judges/all.csv",
    "panel, bought": "judges/bought.csv",
    "panel, product": "judges/product.csv",
}
"""Tables of results, as paths in `docs/`, by the names that the template has for them."""

_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_TIMEOUT_S = 240

Row = dict[str, str]


def main(folder: Path, out: Path) -> None:
    """Write report.html, and report.pdf where there is a browser of the Chromium family.

    Args:
        folder: Folder `docs` of the repository.
        out: Folder for the report.
    """
    html, pdf = out / "report.html", out / "report.pdf"
    write_text(html, page(folder))
    if program := browser():
        print_page(html, pdf, program)
        print(f"Written: {html}, {pdf}")
    else:
        print(
            f"Written: {html}. There is no Chromium, which prints report.pdf (Debian: apt-get "
            "install chromium)."
        )


def page(folder: Path) -> str:
    """Return the page, which needs no other file and no network.

    Args:
        folder: Folder with the results, the figures and `references.bib`: `docs` of the repository.

    Raises:
        ValueError: A number, a sentence or a source that the template names is not there.
        OSError: A file is missing.
    """
    loader = FileSystemLoader(Path(__file__).parent)
    environment = Environment(
        loader=loader,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    results, sources = Results(folder), Sources(folder / "references.bib")
    given = {name: getattr(results, name) for name in dir(results) if not name.startswith("_")}
    names = {
        "cite": sources.cite,
        "references": sources.listed,
        "picture": partial(_picture, folder),
    }
    return environment.get_template("article.html").render(**given, **names, version=__version__)


class Results:
    """The results in a folder.

    Numbers are marked with the file that they come from, as `<data data-from="...">0.746</data>`,
    and copied sentences as `<q data-from="...">`. So a test can look for each of them in its file.

    Args:
        folder: Folder with the files of `FILES`, which is `docs`.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def rows(self, name: str, **where: Any) -> list[Row]:
        """Return the rows of a table whose cells are as given, numbers compared as numbers.

        Raises:
            ValueError: There is no such table or column.
        """
        if name not in FILES:
            raise ValueError(f"there is no table {name!r}; there are {', '.join(FILES)}")
        table = _read(self._folder / FILES[name])
        for column in where:
            _cell(name, table[0], column)
        return [
            row
            for row in table
            if all(_same(row[column], value) for column, value in where.items())
        ]

    def row(self, name: str, **where: Any) -> Row:
        """Return the only row of a table whose cells are as given.

        Raises:
            ValueError: There is no such row, or more than one.
        """
        found = self.rows(name, **where)
        if len(found) != 1:
            raise ValueError(
                f"{FILES[name]} has {len(found)} rows with {where}; exactly one is needed"
            )
        return found[0]

    def mark(self, name: str, cell: str, form: str = ".3f") -> Markup:
        """Return a cell of a table as a marked number; a dash if it is empty.

        Args:
            name: Name of the table.
            cell: Cell.
            form: Format of the number.
        """
        if cell == "":
            return Markup("\N{EN DASH}")
        text = format(float(cell) + 0.0, form)
        text = (
            text.lstrip("-")
            if not re.search("[1-9]", text)
            else text.replace("-", "\N{MINUS SIGN}")
        )
        return Markup('<data value="{}" data-from="{}">{}</data>').format(cell, FILES[name], text)

    def number(self, name: str, column: str, form: str = ".3f", **where: Any) -> Markup:
        """Return a number of the only row whose cells are as given."""
        return self.mark(name, _cell(name, self.row(name, **where), column), form)

    def mean(self, name: str, column: str, **where: Any) -> Markup:
        """Return a mean with half of its interval, of the only row whose cells are as given."""
        half = "half_95" if "half_95" in self.row(name, **where) else f"{column}_half_95"
        return self.number(name, column, **where) + " ± " + self.number(name, half, **where)

    def interval(self, name: str, column: str = "value", **where: Any) -> Markup:
        """Return a value with its interval, of the only row whose cells are as given."""
        start = "" if column == "value" else f"{column}_"
        low, high = (self.number(name, f"{start}{end}", **where) for end in ("low", "high"))
        return self.number(name, column, **where) + " (" + low + ", " + high + ")"

    def falling(self, name: str, column: str, **where: Any) -> list[Row]:
        """Return rows of a table, the highest number in a column first; those without one are left
        out.
        """
        found = [row for row in self.rows(name, **where) if _cell(name, row, column) != ""]
        return sorted(found, key=lambda row: -float(row[column]))

    def first(self, name: str, column: str, *, least: bool = False, **where: Any) -> Row:
        """Return the row with the highest number in a column, or with the least one.

        Raises:
            ValueError: No row has a number in the column.
        """
        found = self.falling(name, column, **where)
        if not found:
            raise ValueError(f"{FILES[name]} has no {column} in the rows with {where}")
        chosen = found[-1 if least else 0][column]
        return next(row for row in self.rows(name, **where) if row[column] == chosen)

    def answer(self, question: str) -> Markup:
        """Return the sentence that answers a question of `python -m studies findings`, by the name
        of its figure.

        Raises:
            ValueError: There is no such answer.
        """
        return self._sentence(
            "findings.md", rf"\]\(findings/{re.escape(question)}\.png\)\n\n(.+)\n", question
        )

    def _sentence(self, path: str, pattern: str, name: str) -> Markup:
        found = re.search(pattern, (self._folder / path).read_text(encoding="utf-8"))
        if found is None:
            raise ValueError(f"{path} has no {name!r}")
        return _quote(path, found[1])


class Sources:
    """The sources that a text cites, numbered in the order of their first citation.

    Args:
        path: BibTeX file.
    """

    def __init__(self, path: Path) -> None:
        self._entries = parse_string(path.read_text(encoding="utf-8"), "bibtex").entries
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
        style, html = (
            find_plugin("pybtex.style.formatting", "plain")(),
            find_plugin("pybtex.backends", "html")(),
        )
        data = BibliographyData({key: self._entries[key] for key in self._cited})
        written = {one.key: one.text.render(html) for one in style.format_bibliography(data)}
        items = (
            Markup('<li id="{}">{}</li>').format(key, Markup(written[key])) for key in self._cited
        )
        return Markup('<ol class="references">{}</ol>').format(Markup("\n").join(items))


def browser() -> str | None:
    """Return the path of a browser that prints, None if there is none."""
    return next((found for name in _BROWSERS if (found := shutil.which(name))), None)


def print_page(page: Path, pdf: Path, program: str) -> None:
    """Print a page to PDF.

    Args:
        page: HTML file.
        pdf: Path of the PDF.
        program: Path of the browser, Chromium or one of its family.

    Raises:
        ValueError: The browser wrote no PDF; the message has what it printed.
    """
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer"]
    with tempfile.TemporaryDirectory() as profile, replacing(pdf) as temporary:
        options += [f"--user-data-dir={profile}", f"--print-to-pdf={temporary.resolve()}"]
        command = [program, *options, page.resolve().as_uri()]
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_TIMEOUT_S, check=False
        )
        if not temporary.is_file():
            raise ValueError(f"{program} printed no PDF: {done.stderr.strip()[-300:]}")


def _cell(name: str, row: Row, column: str) -> str:
    if column not in row:
        raise ValueError(f"{FILES[name]} has no column {column!r}; it has {', '.join(row)}")
    return row[column]


def _quote(path: str, text: str) -> Markup:
    """Return a copied text, with minus signs as those of marked numbers."""
    signed = re.sub(r"(?<![\w-])-(?=\d)", "\N{MINUS SIGN}", text)
    return Markup('<q data-from="{}">{}</q>').format(path, signed)


@cache
def _read(path: Path) -> list[Row]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _same(cell: str, value: Any) -> bool:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return cell != "" and abs(float(cell) - value) < 1e-9
    return cell == str(value)


def _picture(folder: Path, path: str) -> str:
    """Return a PNG as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode((folder / path).read_bytes()).decode("ascii")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python docs/_ext/article.py RESULTS OUT, such as docs build/report")
    try:
        main(*map(Path, sys.argv[1:]))
    except (ValueError, OSError) as error:
        sys.exit(f"Error: {error}")
