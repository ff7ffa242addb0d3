"""Figures and the table of the report for papers: PDF and SVG at the width of a column, and LaTeX."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from roletrust_env.storage.files import write_text
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.plots.learners import learners_column
from roletrust_experiments.plots.style import INK
from roletrust_experiments.report.content import Content
from roletrust_experiments.report.latex import latex_table
from roletrust_experiments.report.panels import (
    condition_grids,
    draw_breakdown,
    draw_colours,
    draw_curves,
    draw_heat,
    draw_leaderboard,
    draw_tradeoff,
    grid,
    groups,
    percent,
)
from roletrust_experiments.report.pictures import line_styles
from roletrust_experiments.report.robustness import Robustness

WIDTH = 3.4
"""Width of a figure in inches: a column of IEEE and ACM."""

_STYLE: Any = {
    # Matplotlib has the first one, which goes with the Times of most papers; the second has more letters.
    "font.family": ["STIXGeneral", "DejaVu Sans"],
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "lines.linewidth": 1.1,
    "lines.markersize": 3.2,
    "axes.linewidth": 0.5,
    "grid.linewidth": 0.5,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "xtick.major.pad": 2,
    "ytick.major.pad": 2,
    "axes.labelpad": 2,
    # Text remains text, which can be searched and edited; the default of PDF is Type 3, which IEEE refuses.
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "roletrust",
}


def write_paper(folder: Path, content: Content, command: str) -> None:
    """Write each figure as PDF and SVG, and the leaderboard as LaTeX.

    Args:
        folder: Folder of the files.
        content: Content of the report.
        command: Command that writes them.
    """
    # Matplotlib makes labels of ticks when it draws, so that the style must hold until the file is written.
    with rc_context(_STYLE):
        figures = _of_models(content.robustness) if content.robustness else {}
        if learners := content.learners:
            figures["learners"] = learners_column(learners.found, WIDTH)
        for name, figure in figures.items():
            for suffix in ("pdf", "svg"):
                write_figure(folder / f"{name}.{suffix}", figure)
    if robustness := content.robustness:
        write_text(folder / "leaderboard.tex", latex_table(robustness.leaderboard, command))


def _of_models(robustness: Robustness) -> dict[str, Figure]:
    styles, tables, scale = line_styles(robustness), robustness.tables, robustness.suite.score
    where = robustness.leaderboard.rows[0].worst_condition

    leaderboard, axes = _figure(0.55 + 0.155 * len(robustness.order))
    draw_leaderboard(axes, robustness.leaderboard.rows, scale)

    curves, axes = _figure(2.3)
    draw_curves(axes, groups(tables["curves"]).get(where, []), styles, attacks=False)
    _head(curves, axes, where)

    tradeoff, axes = _figure(2.6)
    draw_tradeoff(axes, groups(tables["tradeoff"]).get(where, []), styles, 10)
    _head(tradeoff, axes, where)

    return {
        "leaderboard": leaderboard,
        "heatmap": _heatmap(robustness),
        "worst_cases": _worst_cases(robustness, list(styles)),
        "curves": curves,
        "breakdown": _breakdown(robustness),
        "tradeoff": tradeoff,
    }


def _heatmap(robustness: Robustness) -> Figure:
    """Return the worst case of each model in each condition with attackers."""
    rows = [row for rows in groups(robustness.tables["worst_cases"]).values() for row in rows if row["share"]]
    cells = [(row["model"], f"{row['scenario']}, {row['track']} {percent(row['share'])}", row["score"]) for row in rows]
    shown = grid(cells, robustness.order, list(dict.fromkeys(condition for _, condition, _ in cells)))
    figure, axes = _figure(1.0 + 0.15 * len(robustness.order))
    lowest = robustness.heat_maps["worst_cases"].lowest
    draw_heat(axes, shown, lowest, numbers=True, rotation=45)
    draw_colours(figure, axes, lowest, robustness.suite.score, aspect=25)
    return figure


def _worst_cases(robustness: Robustness, models: list[str]) -> Figure:
    """Return a heat map of conditions for each of some models."""
    all_grids = condition_grids(robustness.tables["worst_cases"])
    grids = {model: shown for model, shown in all_grids.items() if model in models}
    lowest, many = robustness.heat_maps["worst_cases"].lowest, max(1, -(-len(grids) // 2))
    high = max((len(shown.rows) for shown in grids.values()), default=0)
    figure = Figure(figsize=(WIDTH, 0.3 + many * (0.3 + 0.14 * high)), layout="constrained")
    panels = figure.subplots(many, 2, squeeze=False, sharey=True)
    for axes, (model, shown) in zip(panels.flat, grids.items(), strict=False):
        draw_heat(axes, shown, lowest, numbers=True)
        axes.set_title(model, loc="left", color=INK, pad=3)
    for axes in panels.flat[len(grids) :]:
        axes.set_visible(False)
    draw_colours(figure, panels, lowest, robustness.suite.score, aspect=25)
    figure.supxlabel("share of the compromised", fontsize="medium", color=INK)
    return figure


def _breakdown(robustness: Robustness) -> Figure:
    """Return the worst-case score by share for the tracks with several shares, or for all if there is none."""
    tracks = groups(robustness.tables["breakdown"])
    several = {where: rows for where, rows in tracks.items() if len({row["share"] for row in rows if row["share"]}) > 1}
    chosen = several or tracks
    many = max(1, len(chosen))
    figure = Figure(figsize=(WIDTH, 0.45 + 1.6 * many), layout="constrained")
    panels = np.ravel(figure.subplots(many, sharex=True))
    for axes, (where, rows) in zip(panels, chosen.items(), strict=False):
        draw_breakdown(axes, rows, line_styles(robustness))
        axes.set_ylabel(f"worst-case {robustness.suite.score}", color=INK)
        axes.set_title(where, loc="left", color=INK)
    panels[-1].set_xlabel("share of the compromised", color=INK)
    _legend(figure, panels[-1])
    return figure


def _figure(height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    return figure, figure.subplots()


def _head(figure: Figure, axes: Axes, condition: str) -> None:
    axes.set_title(condition, loc="left", color=INK)
    _legend(figure, axes)


def _legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, frameon=False, loc="outside lower center", ncols=3, labelcolor=INK)
