"""The first picture of those pages of results that have tables only, from their published numbers.

Seconds. Each picture shows columns of a CSV file in `docs/`, in the order of the rows.
"""

import csv
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from roletrust_env.metrics.confidence import Estimate, Interval
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from studies.study import DOCS, Recipe, Study


class Options(NamedTuple):
    """Folder of the tables."""

    docs: Path = DOCS


PICTURES = ("better-model", "leave-one-out", "first-hand", "real")
"""Pages with such a picture."""

RECIPES = {"summaries": Recipe(Options(), {f"{name}.png": f"{name}.png" for name in PICTURES})}

Rows = list[dict[str, str]]


def main(study: Study[Options]) -> None:
    """Draw all pictures."""
    for name, figure in figures(study.options.docs).items():
        study.figure(f"{name}.png", figure)


def figures(docs: Path) -> dict[str, Figure]:
    """Return the figures by the name of their page."""

    def rows(name: str) -> Rows:
        with (docs / name).open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    boards = {
        "better-model": ("better-model.csv", "utility"),
        "leave-one-out": ("leave-one-out.csv", "skill"),
        "first-hand": ("first-hand/leaderboard.csv", "skill"),
    }
    found = {
        name: [Panel("", "", f"{score} of going by trust", _board(rows(table)))]
        for name, (table, score) in boards.items()
    }
    forecasts = [
        row
        for row in rows("real/real.csv")
        if (row["protocol"], row["measure"]) == ("rated before", "r") and row["value"]
    ]
    forecasts.sort(key=lambda row: -float(row["value"]))
    intervals = [Interval(*(float(row[name] or "nan") for name in ("value", "low", "high"))) for row in forecasts]
    one = Series("rated before", [row["model"] for row in forecasts], intervals)
    found["real"] = [Panel("", "", "correlation of trust with ratings of members that have earlier ones", [one])]
    return {name: panels_figure("", panels, "bars: 95% intervals") for name, panels in found.items()}


def _board(rows: Rows) -> list[Series]:
    """Return the clean and the worst case of each model of a leaderboard."""
    names = [row["model"] for row in rows]
    return [
        Series(label, names, [Estimate(float(row[column]), float(row[f"{column}_half_95"])).interval for row in rows])
        for label, column in (("nobody attacks", "clean"), ("worst case", "worst"))
    ]
