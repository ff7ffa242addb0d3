"""Tables of what `roletrust real` measures."""

import math
import textwrap
from collections.abc import Iterator

from rich.markup import escape
from rich.table import Table

from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.commands.console import number_table, short

HEADER = ("log", "sha256", "round", "protocol", "model", "measure", "value", "low", "high")
_ACROSS = 4  # measures side by side in 80 columns, with the interval below the value
_HEADING = 12  # letters
Row = tuple[str, str, float | None, str, str, str, float, float, float]
"""Log, its SHA-256, length of a round or None, protocol, model, measure, value, and the ends of its interval."""


def measure_tables(rows: list[Row]) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return a table for each log and protocol: its title, its headings, and a line for each model."""
    tables = []
    for log, protocol in dict.fromkeys((row[0], row[3]) for row in rows):
        some = {(row[4], row[5]): Interval(*row[6:]) for row in rows if (row[0], row[3]) == (log, protocol)}
        measures = list(dict.fromkeys(what for _, what in some))
        names = dict.fromkeys(name for name, _ in some)
        undefined = Interval(math.nan, math.nan, math.nan)
        lines = [[name, *(_cell(some.get((name, what), undefined)) for what in measures)] for name in names]
        tables.append((f"{log}: {protocol}", ["model", *measures], lines))
    return tables


def _cell(value: Interval) -> str:
    if math.isnan(value.value):
        return "-"
    if math.isnan(value.low):  # a single user or task has no interval
        return f"{value.value:.3f}"
    return f"{value.value:.3f} ({value.low:.3f}, {value.high:.3f})"


def screen_tables(tables: list[tuple[str, list[str], list[list[str]]]]) -> Iterator[Table]:
    """Yield the tables for a terminal of 80 columns; one with many measures goes on in further tables."""
    for title, headings, lines in tables:
        for at in range(1, len(headings), _ACROSS):
            measures = (textwrap.fill(heading, _HEADING) for heading in headings[at : at + _ACROSS])
            table = number_table(title + ", continued" * (at > 1), "", *measures, name="model")
            for name, *cells in lines:
                shown = (short(cell).replace(" (", "\n(") for cell in cells[at - 1 : at - 1 + _ACROSS])
                table.add_row(escape(name), *shown)
            yield table


def markdown(tables: list[tuple[str, list[str], list[list[str]]]], left_out: list[str]) -> str:
    """Return the tables as Markdown."""
    parts = ["# Trust models on real ratings"]
    for title, headings, lines in tables:
        parts += [f"## {title}", markdown_table(headings, lines, names=1)]
    if left_out:
        parts.append("\n".join(f"- Left out: {reason}." for reason in left_out))
    return "\n\n".join(parts) + "\n"
