"""Figures of attackers: the worst case by the rounds of the search, and the transfer between trust models."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from roletrust_experiments.plots.style import ATTACKER, ATTACKERS, DASHES, HONEST, INK, QUIET

if TYPE_CHECKING:
    from studies.attackers.budget import Level
    from studies.attackers.transfer import Cell

_COLOURS = (QUIET, HONEST[0], HONEST[1], ATTACKERS[0], ATTACKERS[1], ATTACKERS[2], HONEST[2], HONEST[3])
_MARKS = ("o", "s", "^", "D", "v", "P", "X", "*")
_COLUMNS, _WIDE, _HIGH = 3, 4.0, 3.0  # panels side by side, and inches of a panel
_CELL, _LETTER = 0.46, 0.085  # inches of a cell of the heat map, and of a letter of its names
_DARK = 0.35  # distance from 0.5 beyond which numbers are white
_ROOM = 0.1  # of utility, below and above the means; wider intervals are cut


def budget_figure(about: str, levels: "Sequence[Level]", note: str) -> Figure:
    """Return a panel for each trust model with a line for each way to attack.

    Args:
        about: Title.
        levels: Worst cases.
        note: Note below the panels.
    """
    models = list(dict.fromkeys(level.model for level in levels))
    ways = list(dict.fromkeys(level.way for level in levels))
    columns = min(len(models), _COLUMNS)
    down = -(-len(models) // columns)
    figure = Figure(figsize=(_WIDE * max(columns, 1.8), _HIGH * down + 1.1), layout="constrained")
    grid = figure.subplots(down, columns, squeeze=False, sharex=True, sharey=True)
    for k, (axes, model) in enumerate(zip(grid.flat, models, strict=False)):
        for place, way in enumerate(ways):
            _line(axes, [level for level in levels if (level.model, level.way) == (model, way)], place)
        _quiet(axes, _label(model))
        axes.set_xscale("log")
        axes.set_ylabel("utility of the consumer" if k % columns == 0 else "", color=INK)
        if k + columns >= len(models):
            axes.set_xlabel("rounds of the search", color=INK)
            axes.tick_params(labelbottom=True)
    for axes in grid.flat[len(models) :]:
        axes.set_visible(False)
    means = [level.utility.mean for level in levels]
    grid[0, 0].set_ylim(max(-0.02, np.nanmin(means) - _ROOM), min(1.02, np.nanmax(means) + _ROOM))
    budgets = sorted({level.budget for level in levels if level.budget})
    grid[0, 0].set_xticks(budgets, [_short(limit) for limit in budgets])
    grid[0, 0].set_xticks([], minor=True)
    figure.suptitle(about, x=0.012, ha="left", fontsize=13, fontweight="bold", color=INK)
    keys = {label: one for axes in grid.flat for one, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(
        keys.values(), keys.keys(), loc="outside lower left", ncols=4, frameon=False, fontsize=9, labelcolor=INK
    )
    figure.supxlabel(note, x=0.99, ha="right", fontsize=8.5, color=QUIET)
    return figure


def transfer_figure(about: str, cells: "Sequence[Sequence[Cell]]", note: str) -> Figure:
    """Return a heat map of the utility: trained on the rows, played on the columns.

    Args:
        about: Title.
        cells: Cells by row and column.
        note: Note below the map.
    """
    rows, columns = [_label(row[0].coalition.name) for row in cells], [_label(cell.model) for cell in cells[0]]
    names = _LETTER * max(map(len, (*rows, *columns)))
    figure = Figure(
        figsize=(max(5.5, _CELL * len(columns) + names + 1.6), _CELL * len(rows) + names + 1.6), layout="constrained"
    )
    axes = figure.subplots()
    values = np.array([[cell.utility.mean for cell in row] for row in cells])
    colours = LinearSegmentedColormap.from_list("utility", [ATTACKER, "#FDF3EC", HONEST[0]])
    image = axes.imshow(np.ma.masked_invalid(values), cmap=colours, vmin=0, vmax=1, aspect="auto")
    for k, row in enumerate(cells):
        for j, cell in enumerate(row):
            ink = "white" if abs(values[k, j] - 0.5) > _DARK else INK
            axes.text(j, k, f"{values[k, j]:.2f}", ha="center", va="center", fontsize=7.5, color=ink)
            if cell.seen:
                axes.add_patch(Rectangle((j - 0.47, k - 0.47), 0.94, 0.94, fill=False, edgecolor=INK, linewidth=1.5))
    axes.set_xticks(range(len(columns)), columns, rotation=55, ha="right", rotation_mode="anchor", fontsize=8.5)
    axes.set_yticks(range(len(rows)), rows, fontsize=8.5)
    axes.tick_params(colors=QUIET, labelcolor=INK, length=0)
    axes.set_xlabel("played on", color=INK)
    axes.set_ylabel("trained on, or universal", color=INK)
    for side in axes.spines.values():
        side.set_visible(False)
    figure.colorbar(image, ax=axes, shrink=0.7, pad=0.01).set_label("utility of the consumer", color=INK)
    figure.suptitle(about, x=0.012, ha="left", fontsize=12, fontweight="bold", color=INK)
    figure.supxlabel(note, x=0.99, ha="right", fontsize=8.5, color=QUIET)
    return figure


def _line(axes: Axes, levels: "Sequence[Level]", place: int) -> None:
    """Draw the line of a way with the band of its intervals; a way without a choice of rounds is a dotted line."""
    if not levels:
        return
    colour = _COLOURS[place % len(_COLOURS)]
    at = np.array([level.at for level in levels], np.float64)
    mean, half = (np.array([level.utility[k] for level in levels]) for k in (0, 1))
    look: dict[str, Any] = {"color": colour, "linestyle": DASHES[place % 4], "marker": _MARKS[place % len(_MARKS)]}
    axes.plot(at, mean, label=levels[0].way, linewidth=1.6, markersize=4.5, zorder=3, **look)
    if len(levels) > 1:
        axes.fill_between(at, mean - half, mean + half, color=colour, alpha=0.12, linewidth=0)
        return
    axes.errorbar(at, mean, yerr=np.nan_to_num(half), color=colour, capsize=2.5, linewidth=1, zorder=3)
    if not levels[0].budget:
        axes.axhline(mean[0], color=colour, linestyle=(0, (1, 2)), linewidth=1, zorder=1)


def _label(name: str) -> str:
    """Return the name of a trust model without the module of a class of its own."""
    module, _, rest = name.partition(":")
    return rest if "." in module else name


def _short(rounds: int) -> str:
    return f"{rounds / 1000:g}k" if rounds < 1_000_000 else f"{rounds / 1_000_000:g}M"


def _quiet(axes: Axes, title: str) -> None:
    axes.set_title(title, loc="left", fontsize=10.5, color=INK)
    axes.grid(axis="y", color="#E5E7EB", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=QUIET, labelcolor=INK, length=3)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color("#9CA3AF")
