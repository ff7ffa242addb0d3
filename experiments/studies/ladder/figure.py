"""The figure of a ladder: the rungs as bars, and below them the scripted attack beside the best one."""

from collections.abc import Sequence
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from roletrust_experiments.plots.style import ATTACKER, ATTACKERS, HONEST, INK, QUIET, tidy
from studies.ladder.trajectory import Floats, Trajectory

if TYPE_CHECKING:
    from studies.ladder.rows import Row

_SHOWN = 40
"""Number of rounds to draw; more would be too dense."""

_MAPS = 3
"""Maximum number of raters with a map of their ratings."""

_FEW = 3  # maximum number of ratings of a rater with a line each
_COLOURS = {"honest play": HONEST[0], "exact": INK, "best known": INK}
_OTHERS = "#9CA3AF"


def ladder_figure(about: str, rows: "Sequence[Row]", trajectories: Sequence[Trajectory]) -> Figure:
    """Return the figure of a ladder.

    Args:
        about: Title.
        rows: Rows of the ladder, from honest play upwards.
        trajectories: Trajectories of the scripted attack and of the best one.
    """
    # Many ratings are drawn as a map with a row for each honest provider.
    maps = [name for name, values in trajectories[0].ratings.items() if _is_many(trajectories, values)][:_MAPS]
    height, below_height = 0.9 + 0.36 * len(rows), 6.6 + 1.0 * len(maps)
    figure = Figure(figsize=(10.4, height + below_height), layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=[height, below_height], hspace=0.03)
    top, below = halves
    _bars(top.subplots(), rows)
    top.suptitle(about, x=0.012, ha="left", fontsize=13, fontweight="bold", color=INK)
    grid = below.subplots(3 + len(maps), 2, sharex=True, sharey="row", height_ratios=[2] * 3 + [1] * len(maps))
    for k, (column, trajectory) in enumerate(zip(grid.T, trajectories, strict=True)):
        _actions(column[0], trajectory)
        _trust(column[1], trajectory)
        _gains(column[2], trajectory)
        column[0].set_title(trajectory.name, loc="left", fontsize=12, fontweight="bold", color=INK, pad=24)
        for axes, name in zip(column[3:], maps, strict=True):
            _map(axes, name, trajectory.ratings[name])
            axes.set_ylabel("" if k else axes.get_ylabel(), color=INK)
        column[-1].set_xlabel("round", color=INK)
        for axes in column[:3]:
            axes.set_ylabel("" if k else axes.get_ylabel(), color=INK)
            _legend(axes)
    return figure


def _bars(axes: Axes, rows: "Sequence[Row]") -> None:
    """Draw a bar for each rung, with honest play at the bottom, and a point for each run."""
    scores = [row.score for row in rows]
    best = max(row.score for row in rows if row.name not in _COLOURS)
    low, high = min(0.0, *scores), max(0.0, *scores)
    # The bar of a script far below honest play is cut, because it would compress all others; its number is printed.
    low = max(low, -0.25 * high)
    for place, row in enumerate(rows):
        colour = _COLOURS.get(row.name, ATTACKER if row.score == best else _OTHERS)
        axes.barh(place, max(row.score, low), color=colour, height=0.66, zorder=2)
        if row.score < low:
            axes.text(low, place, " ◂", va="center", fontsize=9, color="white")
        elif row.half > 0:
            axes.errorbar(row.score, place, xerr=row.half, color=INK, capsize=2.5, linewidth=1, zorder=3)
        if len(row.runs) > 1 and row.score >= low:
            points: Any = {"s": 13, "color": "white", "edgecolors": INK, "linewidths": 0.7, "zorder": 4}
            axes.scatter(row.scores, [place - 0.2] * len(row.runs), **points)
        share = "" if np.isnan(row.share) else f"   share {row.share:.3f}"
        number = f"{row.score:.4f}" + (f" ± {ceil(row.half * 1e4) / 1e4:.4f}" if row.half > 0 else "")
        end = max(0.0, row.score + row.half, *row.scores)
        axes.text(end + 0.012 * (high - low), place, number + share, va="center", fontsize=9.5, color=INK)
    axes.set_yticks(range(len(rows)), [row.name for row in rows], color=INK)
    axes.set_xlim(low * 1.02, low + (high - low) * 1.42)
    runs = len(rows[0].runs)
    over = (
        f"and the 95% interval of the mean over {runs} runs, which are the points"
        if runs > 1
        else "in its 95% interval"
    )
    axes.set_xlabel(f"score: mean reward per round, {over}", color=INK)
    axes.axvline(0, color=QUIET, linewidth=0.8)
    axes.grid(axis="x", color="#E5E7EB", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=QUIET, labelcolor=INK, length=0)
    for side in ("top", "right", "left", "bottom"):
        axes.spines[side].set_visible(False)


def _actions(axes: Axes, trajectory: Trajectory) -> None:
    """Draw the actions of the attacker: a line for each quality, and for each rating or their mean."""
    tidy(axes, "what it does")
    colours = _agents(trajectory)
    for name, values in trajectory.quality.items():
        _step(axes, values, f"quality of {name}", colours[name], 1.8)
    for name, values in trajectory.ratings.items():
        if np.ptp(values[1:], axis=1).max() < 1e-9:
            _step(axes, values[:, 0], f"rating of all by {name}", colours[name], 1.8)
            continue
        if len(trajectory.ratings) == 1 and values.shape[1] <= _FEW:
            for j in range(values.shape[1]):
                # Later lines are thinner, so that equal lines stay visible.
                _step(axes, values[:, j], f"rating {j + 1} by {name}", ATTACKERS[j], 4.2 - 1.5 * j)
            continue
        _step(axes, values.mean(axis=1), f"mean rating by {name}", colours[name], 1.6)


def _agents(trajectory: Trajectory) -> dict[str, str]:
    """Return the colour of each compromised agent."""
    names = dict.fromkeys((*trajectory.quality, *trajectory.ratings))
    return {name: ATTACKERS[k % len(ATTACKERS)] for k, name in enumerate(names)}


def _legend(axes: Axes) -> None:
    """Draw a legend in one line above the axes, and reserve its height but not its width."""
    if not axes.get_title(loc="left"):
        axes.set_title(" ", fontsize=10)
    legend = axes.legend(
        loc="lower left",
        bbox_to_anchor=(-0.01, 0.99),
        ncols=5,
        frameon=False,
        labelcolor=INK,
        handlelength=1.3,
        columnspacing=0.9,
        fontsize=8.8,
        borderaxespad=0.2,
    )
    legend.set_in_layout(False)


def _map(axes: Axes, name: str, values: Floats) -> None:
    """Draw the ratings by one rater, with a row for each honest provider; dark is low."""
    shown = np.ma.masked_invalid(values[:_SHOWN].T)
    colours = LinearSegmentedColormap.from_list("lies", [ATTACKER, "#FDF3EC"])
    axes.imshow(shown, cmap=colours, vmin=0, vmax=1, aspect="auto", interpolation="none")
    text = f"ratings by {name}, one row per honest provider; dark is 0, light is 1"
    axes.set_title(text, loc="left", fontsize=8.8, color=INK).set_in_layout(False)
    axes.set_title(" ", fontsize=8.8)
    axes.set_ylabel("provider", color=INK)
    axes.set_yticks([])
    axes.tick_params(colors=QUIET, labelcolor=INK, length=3)
    for side in axes.spines.values():
        side.set_visible(False)


def _is_many(trajectories: Sequence[Trajectory], values: Floats) -> bool:
    """Return whether there are too many ratings for lines, and they differ in some attack."""
    different = any(np.ptp(given[1:], axis=1).max() > 1e-9 for t in trajectories for given in t.ratings.values())
    return different and (values.shape[1] > _FEW or len(trajectories[0].ratings) > 1)


def _trust(axes: Axes, trajectory: Trajectory) -> None:
    """Draw the trust of the attacker's agents, of each if they are few, and the mean of the honest agents."""
    tidy(axes, "trust")
    dashes, colours = {"ToR": "-", "ToP": (0, (4, 1.5))}, _agents(trajectory)
    lines = [(kind, "honest", HONEST[0], values) for kind, values in trajectory.honest.items()]
    if len(colours) <= len(ATTACKERS):
        for name, values in trajectory.own.items():
            kind, _, agent = name.partition(" of ")
            lines.append((kind, agent, colours[agent], values))
    else:
        lines += [(kind, "attackers", ATTACKER, values) for kind, values in trajectory.mine.items()]
    for kind, whose, colour, values in lines:
        axes.plot(values[:_SHOWN], color=colour, linestyle=dashes[kind], lw=1.7, label=f"{kind} {whose}")


def _gains(axes: Axes, trajectory: Trajectory) -> None:
    """Draw the objective and the cost of each round."""
    tidy(axes, "per round")
    rounds = np.arange(min(_SHOWN, len(trajectory.cost)))
    axes.plot(rounds, trajectory.objective[:_SHOWN], color=HONEST[1], lw=1.7, label="objective")
    if not trajectory.price:
        return
    cost = trajectory.cost[:_SHOWN]
    axes.fill_between(rounds, 0, cost, color=ATTACKERS[1], alpha=0.35, lw=0)
    axes.plot(rounds, cost, color=ATTACKERS[1], lw=1.4, label="cost: gap over tolerance")


def _step(axes: Axes, values: Floats, label: str, colour: str, lw: float) -> None:
    axes.step(np.arange(len(values))[:_SHOWN], values[:_SHOWN], where="mid", color=colour, lw=lw, label=label)
