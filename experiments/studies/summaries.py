"""The first picture of those pages of results that have tables only, from their published numbers.

Seconds. Each picture shows columns of a CSV file in `docs/`, in the order of the rows.
"""

import csv
from math import isnan
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from roletrust_env.metrics.confidence import Interval
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from studies.study import DOCS, Recipe, Study


class Options(NamedTuple):
    """Folder of the tables."""

    docs: Path = DOCS


PICTURES = ("better-model", "leave-one-out", "first-hand", "real", "model-costs", "edge-costs")
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
    one = _series("rated before", forecasts, "value", "low", "high")
    found["real"] = [Panel("", "", "correlation of trust with ratings of members that have earlier ones", [one])]
    large = [row for row in rows("model-costs.csv") if row["raters"] == row["providers"] == "300"]
    costs = {
        "model-costs": _by(large, "library", "{}, 300 x 300"),
        "edge-costs": _by(rows("edge-costs.csv"), "ratings_asked", "{} ratings"),
    }
    found |= {name: [Panel("", "", "nanoseconds per rating", series, scale="log")] for name, series in costs.items()}
    ends = dict.fromkeys(costs, "least to greatest of the repeats")
    return {
        name: panels_figure("", panels, f"bars: {ends.get(name, '95% intervals')}") for name, panels in found.items()
    }


def _board(rows: Rows) -> list[Series]:
    """Return the clean and the worst case of each model of a leaderboard."""
    names = [row["model"] for row in rows]
    return [
        Series(label, names, [_around(row[column], row[f"{column}_half_95"]) for row in rows])
        for label, column in (("nobody attacks", "clean"), ("worst case", "worst"))
    ]


def _around(mean: str, half: str) -> Interval:
    middle, width = float(mean), float(half)
    return Interval(middle, middle - width, middle + width)


def _by(rows: Rows, column: str, label: str) -> list[Series]:
    """Return the times of the models by the values of a column."""
    return [
        _series(
            label.format(f"{int(value):,}" if value.isdigit() else value),
            [row for row in rows if row[column] == value],
            *_TIMES,
        )
        for value in dict.fromkeys(row[column] for row in rows)
    ]


_TIMES = ("ns_per_rating", "ns_per_rating_least", "ns_per_rating_greatest")


def _series(label: str, rows: Rows, *columns: str) -> Series:
    """Return the values of some rows, without those that have none."""
    values: dict[str, Any] = {row["model"]: Interval(*(float(row[name] or "nan") for name in columns)) for row in rows}
    there = {name: value for name, value in values.items() if not isnan(value.value)}
    return Series(label, list(there), list(there.values()))
