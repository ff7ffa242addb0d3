"""A table of a report: a CSV file, and what a figure of the page is drawn from."""

from typing import Any, NamedTuple


class Table(NamedTuple):
    """Rows of plain values under a header."""

    header: tuple[str, ...]
    rows: list[tuple[Any, ...]]

    def columns(self) -> dict[str, list[Any]]:
        """The values of each column."""
        return {name: [row[k] for row in self.rows] for k, name in enumerate(self.header)}

    def choices(self) -> list[Any]:
        """What the first column holds: of these the reader of a figure chooses one."""
        return list(dict.fromkeys(row[0] for row in self.rows))
