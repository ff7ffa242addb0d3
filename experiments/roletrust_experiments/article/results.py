"""The results in the repository, and the marked numbers that the report takes from them."""

import csv
import io
import re
from functools import cache
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

FILES = {
    "leaderboard": "leaderboards/standard/leaderboard.csv",
    "conditions": "leaderboards/standard/conditions.csv",
    "transfer": "attackers/transfer.csv",
    "equilibrium": "equilibrium/equilibrium.csv",
    "parts": "leave-one-out.csv",
    "judges": "first-hand/leaderboard.csv",
    "defence": "defence/comparison.csv",
    "defence by iteration": "defence/iterations.csv",
    "real": "real/real.csv",
    "real, weeks": "leave-one-out-7.csv",
    "real, months": "leave-one-out-30.csv",
    "strategic": "strategic/strategic.csv",
}
"""Tables of results, as paths in `docs/`, by the names that the template has for them."""

Row = dict[str, str]


class Results:
    """The results in a folder.

    Numbers are marked with the file that they come from, as `<data data-from="...">0.746</data>`, and copied sentences
    as `<q data-from="...">`. So a test can look for each of them in its file.

    Args:
        folder: Folder with the files of `FILES`, which is `docs`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def rows(self, name: str, **where: Any) -> list[Row]:
        """Return the rows of a table whose cells are as given, numbers compared as numbers.

        Raises:
            ValueError: There is no such table or column.
        """
        if name not in FILES:
            raise ValueError(f"there is no table {name!r}; there are {', '.join(FILES)}")
        table = _read(self.folder / FILES[name])
        for column in where:
            _cell(name, table[0], column)
        return [row for row in table if all(_same(name, row[column], value) for column, value in where.items())]

    def row(self, name: str, **where: Any) -> Row:
        """Return the only row of a table whose cells are as given.

        Raises:
            ValueError: There is no such row, or more than one.
        """
        found = self.rows(name, **where)
        if len(found) != 1:
            raise ValueError(f"{FILES[name]} has {len(found)} rows with {where}; exactly one is needed")
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
        text = format(_number(name, cell) + 0.0, form)
        text = text.lstrip("-") if not re.search("[1-9]", text) else text.replace("-", "\N{MINUS SIGN}")
        return Markup('<data value="{}" data-from="{}">{}</data>').format(cell, FILES[name], text)

    def number(self, name: str, column: str, form: str = ".3f", **where: Any) -> Markup:
        """Return a number of the only row whose cells are as given."""
        return self.mark(name, _cell(name, self.row(name, **where), column), form)

    def mean(self, name: str, column: str, **where: Any) -> Markup:
        """Return a mean with half of its interval, of the only row whose cells are as given."""
        row = self.row(name, **where)
        half = "half_95" if "half_95" in row else f"{column}_half_95"
        return self.mark(name, _cell(name, row, column)) + " ± " + self.mark(name, _cell(name, row, half))

    def interval(self, name: str, column: str = "value", **where: Any) -> Markup:
        """Return a value with its interval, of the only row whose cells are as given."""
        row, start = self.row(name, **where), "" if column == "value" else f"{column}_"
        low, high = (self.mark(name, _cell(name, row, f"{start}{end}")) for end in ("low", "high"))
        return self.mark(name, _cell(name, row, column)) + " (" + low + ", " + high + ")"

    def first(self, name: str, column: str, *, least: bool = False, **where: Any) -> Row:
        """Return the row with the highest number in a column, or with the least one."""
        found = [row for row in self.rows(name, **where) if _cell(name, row, column) != ""]
        if not found:
            raise ValueError(f"{FILES[name]} has no {column} in the rows with {where}")
        return (min if least else max)(found, key=lambda row: _number(name, row[column]))

    def falling(self, name: str, column: str) -> list[Row]:
        """Return the rows of a table, the highest number in a column first; those without one are left out."""
        found = [row for row in self.rows(name) if _cell(name, row, column) != ""]
        return sorted(found, key=lambda row: -_number(name, row[column]))

    def breaking(self) -> list[tuple[Markup, Markup]]:
        """Return the models of the answer about the breaking shares by range of shares, see `answer`."""
        found = re.findall(r"(\d+% to \d+%) lie with ([^;.]+)", self.answer("breaking"))
        if not found:
            raise ValueError("findings.md names no shares in its answer 'breaking'")
        return [(_quote("findings.md", share), _quote("findings.md", models)) for share, models in found]

    def answer(self, question: str) -> Markup:
        """Return the sentence that answers a question of `python -m studies.findings`, by the name of its figure."""
        text = read_text(self.folder / "findings.md")
        found = re.search(rf"\n(.+)\n\n!\[[^\]]*\]\(findings/{re.escape(question)}\.png\)", text)
        if found is None:
            raise ValueError(f"findings.md has no answer {question!r}")
        return _quote("findings.md", found[1])

    def fact(self, what: str) -> Markup:
        """Return a value of the table of facts about the equilibrium, by its name there."""
        path = "equilibrium/equilibrium.md"
        text = read_text(self.folder / path)
        found = re.search(rf"^\| {re.escape(what)} \| (.+) \|$", text, flags=re.MULTILINE)
        if found is None:
            raise ValueError(f"{path} has no {what!r}")
        return _quote(path, found[1])


def _cell(name: str, row: Row, column: str) -> str:
    if column not in row:
        raise ValueError(f"{FILES[name]} has no column {column!r}; it has {', '.join(row)}")
    return row[column]


def _quote(path: str, text: str) -> Markup:
    """Return a copied text, with minus signs as those of marked numbers."""
    signed = re.sub(r"(?<![\w-])-(?=\d)", "\N{MINUS SIGN}", text)
    return Markup('<q data-from="{}">{}</q>').format(path, escape(signed))


@cache
def _read(path: Path) -> list[Row]:
    rows = list(csv.DictReader(io.StringIO(read_text(path), newline=""), restkey="", restval=None))
    if not rows:
        raise ValueError(f"{path} has no rows")
    for number, row in enumerate(rows, 2):
        if "" in row or None in row.values():
            raise ValueError(f"row {number} of {path} has another number of cells than its header")
    return rows


def read_text(path: Path) -> str:
    """Return a text file.

    Raises:
        ValueError: It is not UTF-8; the message names it.
        OSError: It cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is not UTF-8 text: {error.reason} at byte {error.start}") from None


def _number(name: str, cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise ValueError(f"{FILES[name]} has {cell[:100]!r} where a number is needed") from None


def _same(name: str, cell: str, value: Any) -> bool:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return cell != "" and abs(_number(name, cell) - value) < 1e-9
    return cell == str(value)
