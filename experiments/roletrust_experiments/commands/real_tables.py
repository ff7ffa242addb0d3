"""Tables of what `roletrust real` measures."""

import math

from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.markdown import markdown_table

HEADER = ("log", "sha256", "round", "protocol", "model", "measure", "value", "low", "high")
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


def markdown(tables: list[tuple[str, list[str], list[list[str]]]], left_out: list[str]) -> str:
    """Return the tables as Markdown."""
    parts = ["# Trust models on real ratings"]
    for title, headings, lines in tables:
        parts += [f"## {title}", markdown_table(headings, lines, names=1)]
    if left_out:
        parts.append("\n".join(f"- Left out: {reason}." for reason in left_out))
    return "\n\n".join(parts) + "\n"
