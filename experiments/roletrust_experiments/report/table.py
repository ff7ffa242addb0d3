"""A table of a report: the content of a CSV file and the data of a figure."""

from typing import Any, NamedTuple


class Table(NamedTuple):
    """Rows of plain values under a header."""

    header: tuple[str, ...]
    rows: list[tuple[Any, ...]]

    def columns(self) -> dict[str, list[Any]]:
        """Return the values of each column."""
        return {name: [row[k] for row in self.rows] for k, name in enumerate(self.header)}

    def choices(self) -> list[Any]:
        """Return the values of the first column, one of which the reader of a figure selects."""
        return list(dict.fromkeys(row[0] for row in self.rows))
