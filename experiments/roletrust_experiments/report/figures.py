"""Figures of a report, each drawn once, for the page and for files."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from roletrust_env.benchmarking.leaderboard import BoardRow
from roletrust_env.benchmarking.suite import RULES
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.plots.learners import learners_figure
from roletrust_experiments.plots.style import ATTACKER, ATTACKERS, HONEST, INK, QUIET, quiet
from roletrust_experiments.report.board import TrustModels, label
from roletrust_experiments.report.content import Content

_COLOURS = (HONEST[0], ATTACKERS[0], HONEST[1], ATTACKERS[2], ATTACKERS[1], HONEST[2], ATTACKERS[3])
_DASHES: tuple[Any, ...] = ("-", (0, (7, 3)), (0, (2, 2)), (0, (9, 3, 2, 3)))
_WIDTH = 10  # of a figure, inches
_ROW, _PANEL = 0.3, 3.2  # heights of a row of the heat map, and of a panel with lines, inches
_NARROW = 0.19  # height of a row of the leaderboard, inches: it is seen at a glance
_PANELS = 2  # with lines side by side
_STYLE: Any = {  # Matplotlib's type of settings is a list of all their names
    # Text remains text, which can be searched and edited; the default of PDF is Type 3, which IEEE
    # refuses.
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "roletrust",
}
"""Settings of Matplotlib."""


def write_figures(folder: Path, content: Content, *suffixes: str) -> list[str]:
    """Write each figure of a report, and return their names, which are those of their tables.

    Args:
        folder: Folder of the files.
        content: Content of the report.
        suffixes: Suffixes of the files, which give their formats.
    """
    # Matplotlib makes labels of ticks when it draws, so that the style must hold until the file is
    # written.
    with rc_context(_STYLE):
        figures = _figures(content.models) if content.models else {}
        if learners := content.learners:
            figures["learners"] = learners_figure(
                learners.suite.title, learners.results, learners.scales
            )
        for name, figure in figures.items():
            for suffix in suffixes:
                write_figure(
                    folder / f"{name}{suffix}", figure, colours=256 if suffix == ".png" else None
                )
    return list(figures)


def _figures(models: TrustModels) -> dict[str, Figure]:
    """Return the figures of trust models by the name of their table."""
    return {
        "leaderboard": leaderboard_figure(models.board.rows),
        "worst_cases": _heatmap(models),
        "curves": _curves(models),
    }


def _styles(models: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Return colour and dash of each model, so that colour is never the only difference."""
    return {
        model: {"color": _COLOURS[k % 7], "linestyle": _DASHES[k % 4]}
        for k, model in enumerate(models)
    }


def leaderboard_figure(rows: Sequence[BoardRow]) -> Figure:
    """Return clean and worst-case skill of each model with their intervals, and the worst case of
    the solo model as a line. Each choice rule has a panel.

    Args:
        rows: Rows of the leaderboard, from the best model of a choice rule to the worst.
    """
    groups = [(rule, [row for row in rows if row.rule == rule]) for rule in RULES]
    groups = [(rule, group) for rule, group in groups if group]
    most = max(len(group) for _, group in groups)
    figure = Figure(figsize=(_WIDTH, _NARROW * (most + 5)), layout="constrained")
    panels = figure.subplots(1, len(groups), sharex=True, squeeze=False)[0]
    for axes, (rule, group) in zip(panels, groups, strict=True):
        _draw_board(axes, group)
        axes.set_title(f"{rule} choice rule", loc="left", color=INK)
        axes.set_ylim(most - 0.4, -0.6)
    lines, names = panels[0].get_legend_handles_labels()
    figure.legend(
        lines, names, frameon=False, loc="outside upper left", ncols=len(names), labelcolor=INK
    )
    figure.supxlabel("skill score, with 95% intervals; dotted lines between tiers", color=INK)
    return figure


def _draw_board(axes: Axes, rows: Sequence[BoardRow]) -> None:
    """Draw the models of a choice rule."""
    places = np.arange(len(rows))
    for name, column, colour, mark in (
        ("clean", "clean", HONEST[0], "o"),
        ("worst case", "worst", ATTACKER, "s"),
    ):
        estimates = [row.estimates[column] for row in rows]
        means = [estimate.mean for estimate in estimates]
        halves = np.nan_to_num([estimate.half for estimate in estimates])
        axes.errorbar(means, places, xerr=halves, fmt=mark, color=colour, label=name, capsize=2.5)
    ends = [(row.estimates["worst"].mean, row.estimates["clean"].mean) for row in rows]
    axes.hlines(places, *zip(*ends, strict=True), color="#9CA3AF", linewidth=1, zorder=0)
    first = rows[0].estimates
    solo = first["worst"].mean - first["gain"].mean  # the same in all rows
    axes.axvline(solo, color=QUIET, linestyle="--", linewidth=1, label="worst case of solo")
    axes.set_yticks(places, [f"{row.rank}  {row.model}" for row in rows], fontsize="small")
    for place, (above, below) in enumerate(pairwise(rows)):
        if above.tier != below.tier:
            axes.axhline(place + 0.5, color=QUIET, linestyle=":", linewidth=1)
    quiet(axes, "x")


def _heatmap(models: TrustModels) -> Figure:
    """Return the worst-case skill of each model in each setting, in hundredths; dark is low."""
    skills = {(model, setting): skill.mean for model, setting, skill, *_ in models.cases}
    names, where = list(dict.fromkeys(x for x, _ in skills)), list(models.suite.settings)
    values = np.array([[skills.get((name, x), np.nan) for x in where] for name in names])
    lowest = float(np.fmin.reduce(values, axis=None, initial=1.0))
    figure = Figure(figsize=(_WIDTH, _ROW * (len(names) + 7)), layout="constrained")
    axes = figure.subplots()
    axes.imshow(values, cmap="cividis", vmin=lowest, vmax=1, aspect="auto", interpolation="none")
    axes.set_xticks(
        range(len(where)), where, fontsize="small", rotation=45, ha="right", rotation_mode="anchor"
    )
    axes.set_yticks(range(len(names)), names, fontsize="small")
    axes.tick_params(length=0, labelcolor=INK)
    axes.spines[:].set_visible(False)
    for (row, column), value in np.ndenumerate(values):
        if not np.isnan(value):
            ink = "white" if value - lowest < 0.5 * (1 - lowest) else "black"
            text = f"{100 * value:.0f}".replace("-", "\N{MINUS SIGN}")
            axes.text(column, row, text, color=ink, ha="center", va="center", fontsize="x-small")
    colours = ScalarMappable(Normalize(lowest, 1), "cividis")
    bar: Any = figure.colorbar(colours, ax=axes, label="skill score", pad=0.01, aspect=25)
    bar.outline.set_visible(False)
    return figure


def _curves(models: TrustModels) -> Figure:
    """Return the regret of the first models by round, with a panel for each setting."""
    styles, groups = _styles(models.first), models.attacked
    wide = min(_PANELS, len(groups))
    many = -(-len(groups) // wide)
    figure = Figure(figsize=(_WIDTH, 3 * _ROW + _PANEL * many), layout="constrained")
    panels = figure.subplots(many, wide, squeeze=False)
    for axes, name in zip(panels.flat, groups, strict=False):
        for setting, model, rule, _, regret in models.curves:
            if setting == name and (look := styles.get(shown := label(model, rule))):
                rounds = range(1, len(regret) + 1)
                axes.plot(rounds, regret, label=shown, **look)
        axes.set_title(name, loc="left", color=INK)
        axes.set_xlabel("round", color=INK)
        axes.set_ylabel("regret", color=INK)
        quiet(axes, "y")
    for axes in panels.flat[len(groups) :]:
        axes.set_visible(False)
    lines = {
        label: line
        for axes in panels.flat
        for line, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if lines:
        columns = 3 * _PANELS
        figure.legend(
            lines.values(),
            lines,
            frameon=False,
            loc="outside lower center",
            ncols=columns,
            labelcolor=INK,
        )
    return figure
