"""Panels of the report's images, each drawn on given axes: fonts have the sizes of the figure's style."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure, SubFigure

from roletrust_env.benchmarking.leaderboard import LeaderboardRow
from roletrust_env.benchmarking.suite import Scale
from roletrust_experiments.plots.style import ATTACKER, HONEST, INK, QUIET, tidy
from roletrust_experiments.report.looks import Look
from roletrust_experiments.report.table import Table

Rows = Sequence[Mapping[str, Any]]
"""Rows of a table by the names of its columns."""

_MARKS = {"circle": "o", "square": "s", "triangle": "^", "diamond": "D", "inverted_triangle": "v"}


class Grid(NamedTuple):
    """Values of a heat map.

    Attributes:
        rows: Labels of the rows.
        columns: Labels of the columns.
        values: Values, shape (number of rows, number of columns); NaN where there is none.
        marks: Cells with a mark, as pairs of row and column.
    """

    rows: list[str]
    columns: list[str]
    values: npt.NDArray[np.float64]
    marks: list[tuple[int, int]]


def groups(table: Table) -> dict[Any, list[dict[str, Any]]]:
    """Return the rows of a table by the value of the first column."""
    found: dict[Any, list[dict[str, Any]]] = {}
    for row in table.rows:
        found.setdefault(row[0], []).append(dict(zip(table.header, row, strict=True)))
    return found


def grid(cells: Sequence[tuple[str, str, float]], rows: Sequence[str], columns: Sequence[str]) -> Grid:
    """Return a grid without marks.

    Args:
        cells: Row, column and value of each cell.
        rows: Labels of the rows in their order.
        columns: Labels of the columns in their order.
    """
    values = np.full((len(rows), len(columns)), np.nan)
    for row, column, value in cells:
        values[rows.index(row), columns.index(column)] = value
    return Grid(list(rows), list(columns), values, [])


def percent(share: float) -> str:
    """Return a share for a label, different for different shares."""
    return f"{100 * share:.3g}%"


def condition_grids(table: Table) -> dict[str, Grid]:
    """Return the worst cases of each model: scenarios and tracks by shares.

    Args:
        table: The table `worst_cases`.
    """
    found = {
        model: [(f"{row['scenario']}, {row['track']}", percent(row["share"]), row["score"]) for row in rows]
        for model, rows in groups(table).items()
    }
    shares = list(map(percent, sorted({*table.columns()["share"]})))
    names = list(dict.fromkeys(where for cells in found.values() for where, _, _ in cells))
    return {model: grid(cells, names, shares) for model, cells in found.items()}


def draw_heat(axes: Axes, shown: Grid, lowest: float, *, numbers: bool, rotation: float = 0) -> None:
    """Draw a heat map. Dark is low, and the colours end at 1.

    Args:
        axes: Axes.
        shown: Values.
        lowest: Value at which the colours begin.
        numbers: True if each cell has its value in hundredths.
        rotation: Rotation of the labels of the columns in degrees.
    """
    if shown.values.size:
        axes.imshow(shown.values, cmap="cividis", vmin=lowest, vmax=1, aspect="auto", interpolation="none")
    turned: Any = {"rotation": rotation, "ha": "right", "rotation_mode": "anchor"} if rotation else {}
    axes.set_xticks(range(len(shown.columns)), shown.columns, fontsize="small", **turned)
    axes.set_yticks(range(len(shown.rows)), shown.rows, fontsize="small")
    axes.tick_params(length=0, labelcolor=INK)
    for side in axes.spines.values():
        side.set_visible(False)
    for row, column in shown.marks:
        axes.plot(column, row, "o", color="white", mec="black", ms=5)
    if numbers:
        for (row, column), value in np.ndenumerate(shown.values):
            if not np.isnan(value):
                ink = "white" if value - lowest < 0.5 * (1 - lowest) else "black"
                text = f"{100 * value:.0f}".replace("-", "\N{MINUS SIGN}")
                axes.text(column, row, text, color=ink, ha="center", va="center", fontsize="x-small")


def draw_colours(figure: Figure | SubFigure, beside: Any, lowest: float, label: str, *, aspect: float = 20) -> None:
    """Draw the bar of colours of heat maps.

    Args:
        figure: Figure.
        beside: Axes of the heat maps.
        lowest: Value at which the colours begin.
        label: Label of the bar.
        aspect: Height of the bar divided by its width.
    """
    colours = ScalarMappable(Normalize(lowest, 1), "cividis")
    bar: Any = figure.colorbar(colours, ax=beside, label=label, pad=0.01, aspect=aspect)
    bar.outline.set_visible(False)


def draw_leaderboard(axes: Axes, standings: Sequence[LeaderboardRow], scale: Scale) -> None:
    """Draw clean and worst-case score of each model, with their intervals."""
    places = np.arange(len(standings))
    for name, field, colour, mark in (("clean", "clean", HONEST[0], "o"), ("worst case", "worst", ATTACKER, "s")):
        found = [getattr(row, field) for row in standings]
        halves = [0 if np.isnan(one.half) else one.half for one in found]
        axes.errorbar([one.mean for one in found], places, xerr=halves, fmt=mark, color=colour, label=name, capsize=2.5)
    ends = [(row.worst.mean, row.clean.mean) for row in standings]
    axes.hlines(places, *zip(*ends, strict=True), color="#9CA3AF", linewidth=1, zorder=0)
    axes.set_yticks(places, [f"{row.rank}  {row.model}" for row in standings])
    for place, (above, below) in enumerate(pairwise(standings)):
        if above.tier != below.tier:
            axes.axhline(place + 0.5, color=QUIET, linestyle=":", linewidth=1)
    axes.set_ylim(len(standings) - 0.4, -0.6)
    axes.set_xlabel(f"{scale} of going by trust, with 95% intervals; dotted lines between tiers", color=INK)
    _quiet(axes, "x")
    axes.legend(frameon=False, loc="lower left", ncols=2, bbox_to_anchor=(0, 1), labelcolor=INK)


def draw_curves(axes: Axes, rows: Rows, styles: Mapping[str, Look], *, attacks: bool) -> None:
    """Draw utility round by round in each model's worst case.

    Args:
        axes: Axes.
        rows: Rows of the table `curves` for a condition.
        styles: Styles of the models with a line.
        attacks: True if the labels name the attacks.
    """
    for row in rows:
        if row["worst"] and row["model"] in styles:
            label = f"{row['model']}: {row['attack']}" if attacks else row["model"]
            axes.plot(row["rounds"], row["utility"], label=label, **_line(styles[row["model"]]))
    tidy(axes, "utility")
    axes.set_xlabel("round", color=INK)


def draw_breakdown(axes: Axes, rows: Rows, styles: Mapping[str, Look]) -> None:
    """Draw the worst-case score of each model by the share of compromised agents, with intervals."""
    for model, look in styles.items():
        mine = [row for row in rows if row["model"] == model]
        halves = np.nan_to_num([row["score_half_95"] for row in mine])
        shares, means = [row["share"] for row in mine], [row["score"] for row in mine]
        axes.errorbar(shares, means, yerr=halves, label=model, marker=_MARKS[look.mark], capsize=2.5, **_line(look))
    played = sorted({row["share"] for row in rows})
    axes.set_xticks(played, list(map(percent, played)))
    _quiet(axes, "y")


def draw_tradeoff(axes: Axes, rows: Rows, styles: Mapping[str, Look], size: float) -> None:
    """Draw a mark for each attack at its damage and detectability; the worst case has a large one.

    Args:
        axes: Axes.
        rows: Rows of the table `tradeoff` for a condition.
        styles: Styles of the models with marks.
        size: Area of a mark in square points.
    """
    for model, look in styles.items():
        mine = [row for row in rows if row["model"] == model]
        if mine:
            points = [row["auc"] for row in mine], [row["damage"] for row in mine]
            sizes = [4 * size if row["worst"] else size for row in mine]
            axes.scatter(*points, color=look.colour, marker=_MARKS[look.mark], s=sizes, alpha=0.75, label=model, lw=0)
    axes.axvline(0.5, color=QUIET, linestyle="--", lw=1)  # chance
    axes.set_xlim(-0.03, 1.03)
    axes.set_xlabel("detectability (AUC)", color=INK)
    axes.set_ylabel("damage", color=INK)
    _quiet(axes, "both")


def _line(look: Look) -> dict[str, Any]:
    return {"color": look.colour, "linestyle": (0, look.dash) if look.dash else "-"}


def _quiet(axes: Axes, along: Any) -> None:
    axes.grid(axis=along, color="#E5E7EB")
    axes.set_axisbelow(True)
    axes.tick_params(colors=QUIET, labelcolor=INK, length=3)
    for side in axes.spines.values():
        side.set_visible(False)
