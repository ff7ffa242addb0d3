"""Figures of the report as images for slides and pages: the best models, and a panel for each condition."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from roletrust_env.benchmarking.learners.results import title
from roletrust_experiments.plots.learners import learners_figure
from roletrust_experiments.plots.style import INK
from roletrust_experiments.report.content import Content
from roletrust_experiments.report.looks import Look, looks
from roletrust_experiments.report.panels import (
    Grid,
    Rows,
    condition_grids,
    draw_breakdown,
    draw_colours,
    draw_curves,
    draw_heat,
    draw_leaderboard,
    draw_tradeoff,
    grid,
    groups,
)
from roletrust_experiments.report.robustness import Robustness
from roletrust_experiments.report.table import Table

_LINES = 6
"""Maximum number of models with lines; more would hide each other."""

_COLUMNS = 3
"""Number of models side by side."""


def pictures(content: Content) -> dict[str, Figure]:
    """Return an image for each table by name."""
    found = _of_models(content.robustness) if content.robustness else {}
    if learners := content.learners:
        found["learners"] = learners_figure(title(learners.suite), learners.found, learners.scales)
    return found


def line_styles(robustness: Robustness) -> dict[str, Look]:
    """Return the styles of the models with lines, the best ones."""
    return dict(list(looks(robustness.order).items())[:_LINES])


def _of_models(robustness: Robustness) -> dict[str, Figure]:
    styles, tables, scale = line_styles(robustness), robustness.tables, robustness.suite.score

    def heat(axes: Axes, rows: Rows) -> None:
        shown = robustness.heat_maps["heatmap"]
        draw_heat(axes, _attack_grid(rows, robustness.order, shown.column), shown.lowest, numbers=False, rotation=60)
        draw_colours(axes.figure, axes, shown.lowest, scale)

    def curves(axes: Axes, rows: Rows) -> None:
        draw_curves(axes, rows, styles, attacks=True)
        _legend(axes)

    def breakdown(axes: Axes, rows: Rows) -> None:
        draw_breakdown(axes, rows, styles)
        axes.set_xlabel("share of the compromised", color=INK)
        axes.set_ylabel(f"worst-case {scale}", color=INK)
        _legend(axes)

    def tradeoff(axes: Axes, rows: Rows) -> None:
        draw_tradeoff(axes, rows, styles, 22)
        _legend(axes)

    return {
        "leaderboard": _leaderboard(robustness),
        "heatmap": _panels(tables["heatmap"], heat, (10.4, 0.3 * len(robustness.order) + 2.2)),
        "worst_cases": _worst_cases(robustness),
        "curves": _panels(tables["curves"], curves, (8.4, 3.2)),
        "breakdown": _panels(tables["breakdown"], breakdown, (8.4, 3.2)),
        "tradeoff": _panels(tables["tradeoff"], tradeoff, (8.4, 3.6)),
    }


def _leaderboard(robustness: Robustness) -> Figure:
    standings = robustness.leaderboard.rows
    figure = Figure(figsize=(8.4, 1.3 + 0.3 * len(standings)), layout="constrained")
    draw_leaderboard(figure.subplots(), standings, robustness.suite.score)
    return figure


def _worst_cases(robustness: Robustness) -> Figure:
    """Return a heat map of conditions for each model."""
    grids = condition_grids(robustness.tables["worst_cases"])
    lowest, wide = robustness.heat_maps["worst_cases"].lowest, min(_COLUMNS, max(1, len(grids)))
    many = -(-max(1, len(grids)) // wide)
    height = 0.26 * max((len(one.rows) for one in grids.values()), default=0) + 0.5
    layout = ConstrainedLayoutEngine(hspace=0.1)
    figure = Figure(figsize=(1.6 + 2.9 * wide, height * many + 0.4), layout=layout)
    panels = figure.subplots(many, wide, squeeze=False, sharey=True)
    for axes, (model, shown) in zip(panels.flat, grids.items(), strict=False):
        draw_heat(axes, shown, lowest, numbers=True)
        _name(axes, model)
    for axes in panels.flat[len(grids) :]:
        axes.set_visible(False)
    draw_colours(figure, panels, lowest, f"{robustness.suite.score} in the worst case", aspect=12 * many)
    figure.supxlabel("share of the compromised", fontsize="medium", color=INK)
    return figure


def _panels(table: Table, draw: Callable[[Axes, Rows], None], size: tuple[float, float]) -> Figure:
    """Return a figure with a panel for each value of the first column of a table."""
    found = groups(table)
    figure = Figure(figsize=(size[0], size[1] * max(1, len(found))), layout="constrained")
    for axes, (name, rows) in zip(np.ravel(figure.subplots(max(1, len(found)))), found.items(), strict=False):
        draw(axes, rows)
        _name(axes, name)
    return figure


def _attack_grid(rows: Rows, order: list[str], column: str) -> Grid:
    """Return what each attack leaves of each model in a condition, with a mark for each worst case."""
    attacks = list(dict.fromkeys(row["attack"] for row in rows))
    shown = grid([(row["model"], row["attack"], row[column]) for row in rows], order, attacks)
    marks = [(order.index(row["model"]), attacks.index(row["attack"])) for row in rows if row["worst"]]
    return shown._replace(marks=marks)


def _name(axes: Axes, name: str) -> None:
    axes.set_title(name, loc="left", fontsize=11, fontweight="bold", color=INK)


def _legend(axes: Axes) -> None:
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1, 0.5), fontsize=8.8, labelcolor=INK)
