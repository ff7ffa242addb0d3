"""The first picture of those pages of results that are about trust models, from their published
numbers, and the tables of the leaderboard from its published entries.

Seconds. Each picture shows columns of a CSV file in `docs/`, in the order of the rows.
"""

import csv
from typing import NamedTuple

from matplotlib.figure import Figure

from roletrust_env.benchmarking import Leaderboard, benchmark
from roletrust_env.benchmarking.leaderboard import CASES_HEADER, HEADER
from roletrust_env.metrics.confidence import Interval
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from roletrust_experiments.report.figures import leaderboard_figure
from studies.study import DOCS, Recipe, Study


class Options(NamedTuple):
    """No options."""


STANDARD = "leaderboards/standard/leaderboard"
"""Picture and table of the suite `standard`."""

_TABLES = (f"{STANDARD}.csv", f"{STANDARD}.md", "leaderboards/standard/worst_cases.csv")

PICTURES = (STANDARD, "real")
"""Such pictures."""

_FILES = (*(f"{name}.png" for name in PICTURES), *_TABLES)
RECIPES = {"summaries": Recipe(Options(), {name: name for name in _FILES})}


def main(study: Study[Options]) -> None:
    """Draw all pictures, and write the leaderboard."""
    board = benchmark()
    for name, figure in figures(board).items():
        study.figure(f"{name}.png", figure)
    table, text, cases = _TABLES
    study.text(text, f"{board.to_markdown()}\n\n{board.convergence}\n\n{board.legend}")
    study.csv(table, HEADER, board.lines())
    study.csv(cases, CASES_HEADER, board.case_lines())


def figures(board: Leaderboard) -> dict[str, Figure]:
    """Return the figures by their name in `PICTURES`."""
    with (DOCS / "real/real.csv").open(encoding="utf-8", newline="") as file:
        forecasts = [
            row
            for row in csv.DictReader(file)
            if (row["protocol"], row["measure"]) == ("forecast", "r") and row["value"]
        ]
    forecasts.sort(key=lambda row: -float(row["value"]))
    intervals = [
        Interval(*(float(row[name] or "nan") for name in ("value", "low", "high")))
        for row in forecasts
    ]
    series = Series("forecast", [row["model"] for row in forecasts], intervals)
    panel = Panel(
        "", "", "correlation of trust with ratings of members that have earlier ones", [series]
    )
    return {
        STANDARD: leaderboard_figure(board.rows),
        "real": panels_figure("", [panel], "bars: 95% intervals"),
    }
