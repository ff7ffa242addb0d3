"""Figures of learners: a training run, and a suite with the share of each learner over all tasks and on each task."""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from roletrust_agents.learned import SavedAttacker
from roletrust_env.benchmarking.learners.results import ALL_TASKS, LearnerResult, TaskScale, ranking
from roletrust_experiments.plots.style import ATTACKER, ATTACKERS, DASHES, HONEST, INK, QUIET, quiet

_COLUMNS = 4  # tasks side by side
_LOWEST = -0.5  # lower shares, far below honest play, are drawn here


def learning_figure(algo: str, attacker: SavedAttacker, curve: Sequence[Sequence[float]]) -> Figure:
    """Return the figure of a learning curve, between honest play and the best score."""
    figure = Figure(figsize=(7, 3.6), layout="constrained")
    axes, card = figure.subplots(), attacker.card
    steps, _, score, half = np.asarray(curve, float).T
    axes.fill_between(steps, score - np.nan_to_num(half), score + np.nan_to_num(half), color=ATTACKER, alpha=0.2, lw=0)
    axes.plot(steps, score, color=ATTACKER, marker="o", markersize=3, label=f"{algo}, held-out games")
    axes.axhline(card.score.honest, color=HONEST[0], linestyle="--", label="honest play")
    axes.set_title(f"{card.task.id}, {card.scenario.name}, {card.task.objective}", loc="left", color=INK)
    axes.set_xlabel("rounds of all games", color=INK)
    axes.set_ylabel("mean reward per round", color=INK)
    quiet(axes, "y")
    axes.legend(frameon=False, loc="best")
    return figure


def learners_figure(about: str, found: Sequence[LearnerResult], scales: Mapping[str, TaskScale]) -> Figure:
    """Return the figure of a suite for learners.

    Args:
        about: Title.
        found: Results of the learners, see `roletrust_env.benchmarking.learners.results.aggregate`.
        scales: Scales of the tasks.
    """
    names = ranking(found)
    styles = _styles(names)
    rows = -(-len(scales) // _COLUMNS)
    above, below = 1.2 + 0.4 * max(len(names), 5), 3.0 * rows
    figure = Figure(figsize=(11.6, above + below), layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=[above, below], hspace=0.04)
    bars, curve = halves[0].subplots(1, 2)
    halves[0].suptitle(about, x=0.012, ha="left", fontsize=13, fontweight="bold", color=INK)
    _bars(bars, [one for one in found if one.task == ALL_TASKS], names, styles)
    _curves(curve, [one for one in found if one.task == ALL_TASKS], styles)
    curve.set_title(ALL_TASKS, loc="left", fontsize=10, color=INK)
    grid = halves[1].subplots(rows, min(_COLUMNS, len(scales)), squeeze=False, sharey=True)
    for axes in grid.flat[len(scales) :]:
        axes.set_visible(False)
    for axes, (task, scale) in zip(grid.flat, scales.items(), strict=False):
        _curves(axes, [one for one in found if one.task == task], styles)
        axes.set_title(f"{task}\n{fill('1 is ' + scale.description, 38)}", loc="left", fontsize=9, color=INK)
    for axes in [curve, *grid[:, 0]]:
        axes.set_ylabel("share, interquartile mean", color=INK)
    return figure


def _styles(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the colour and the dash of each learner."""
    colours = [*HONEST, *ATTACKERS]
    return {
        name: {"color": colours[k % len(colours)], "linestyle": DASHES[k // len(colours) % len(DASHES)]}
        for k, name in enumerate(names)
    }


def _bars(
    axes: Axes, found: Sequence[LearnerResult], names: Sequence[str], styles: Mapping[str, dict[str, Any]]
) -> None:
    """Draw the share of each learner with the largest budget and its interval, the best on top."""
    largest = max((one.budget for one in found), default=0)
    mine = {one.learner: one.share for one in found if one.budget == largest}
    for place, name in enumerate(reversed(names)):
        if name not in mine:
            axes.text(0, place, " not on every task", va="center", fontsize=9, color=styles[name]["color"])
            continue
        value, low, high = np.maximum(mine[name], _LOWEST)
        axes.barh(place, value, color=styles[name]["color"], height=0.62, zorder=2)
        if not np.isnan(low):
            axes.plot([low, high], [place, place], color=INK, linewidth=1.2, zorder=3)
        axes.text(np.nanmax([value, high, 0]) + 0.02, place, f"{mine[name].value:.3f}", va="center", fontsize=9.5)
    axes.set_yticks(range(len(names)), list(reversed(names)), color=INK)
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.set_xlim(min(0.0, axes.get_xlim()[0]), max(1.0, axes.get_xlim()[1]) * 1.12)
    axes.axvline(1, color=QUIET, linewidth=0.8, linestyle="--")
    axes.set_xlabel(f"share with {largest:,} rounds, 95% interval", color=INK)
    quiet(axes, "x")


def _curves(axes: Axes, found: Sequence[LearnerResult], styles: Mapping[str, dict[str, Any]]) -> None:
    """Draw a line for each learner: its share by the number of rounds that it may play."""
    for name, style in styles.items():
        mine = sorted((one for one in found if one.learner == name), key=lambda one: one.budget)
        budgets = [one.budget for one in mine]
        value, low, high = np.maximum(np.array([one.share for one in mine]).reshape(-1, 3).T, _LOWEST)
        axes.fill_between(budgets, low, high, color=style["color"], alpha=0.13, linewidth=0)
        axes.plot(budgets, value, marker="o", markersize=3.5, label=name, **style)
    axes.axhline(1, color=QUIET, linewidth=0.8, linestyle="--")
    axes.axhline(0, color=QUIET, linewidth=0.8)
    budgets = sorted({one.budget for one in found})
    axes.set_xscale("log")
    axes.set_xticks(budgets, [f"{budget / 1000:g}k" for budget in budgets])
    axes.set_xticks([], minor=True)
    axes.set_xlabel("rounds of play", color=INK)
    quiet(axes, "y")
