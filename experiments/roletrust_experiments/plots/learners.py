"""Figures of learners: a training run, and a suite with the share of each learner over all tasks
and on each task.
"""

from collections.abc import Mapping, Sequence
from textwrap import fill

import numpy as np
from matplotlib.figure import Figure

from roletrust_agents.learned import SavedAttacker
from roletrust_env.benchmarking.learners.results import ALL_TASKS, LearnerResult, TaskScale, ranking
from roletrust_env.metrics.confidence import Interval
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from roletrust_experiments.plots.style import ATTACKER, HONEST, INK, quiet

_LOWEST = -0.5  # lower shares, far below honest play, are drawn here


def learning_figure(algo: str, attacker: SavedAttacker, curve: Sequence[Sequence[float]]) -> Figure:
    """Return the figure of a learning curve, between honest play and the best score."""
    figure = Figure(figsize=(7, 3.6), layout="constrained")
    axes, card = figure.subplots(), attacker.card
    steps, _, score, half = np.asarray(curve, float).T
    axes.fill_between(
        steps,
        score - np.nan_to_num(half),
        score + np.nan_to_num(half),
        color=ATTACKER,
        alpha=0.2,
        lw=0,
    )
    axes.plot(
        steps, score, color=ATTACKER, marker="o", markersize=3, label=f"{algo}, held-out games"
    )
    axes.axhline(card.score.honest, color=HONEST[0], linestyle="--", label="honest play")
    axes.set_title(
        f"{card.task.id}, {card.scenario.name}, {card.task.objective}", loc="left", color=INK
    )
    axes.set_xlabel("rounds of all games", color=INK)
    axes.set_ylabel("mean reward per round", color=INK)
    quiet(axes, "y")
    axes.legend(frameon=False, loc="best")
    return figure


def learners_figure(
    about: str, results: Sequence[LearnerResult], scales: Mapping[str, TaskScale]
) -> Figure:
    """Return the figure of a suite for learners: the share of each by the number of rounds that it
    may play.

    Args:
        about: Title.
        results: Results of the learners, see
            `roletrust_env.benchmarking.learners.results.aggregate`.
        scales: Scales of the tasks.
    """
    panels, budgets = [], sorted({result.budget for result in results})
    top = Series("share 1", budgets, [Interval(1.0, 1.0, 1.0)] * len(budgets), known=True)
    titles = {task: fill(f"{task}: 1 is {scale.description}", 44) for task, scale in scales.items()}
    for task, title in {ALL_TASKS: ALL_TASKS, **titles}.items():
        series = []
        for name in ranking(results):
            mine = sorted(
                (result for result in results if (result.task, result.learner) == (task, name)),
                key=lambda result: result.budget,
            )
            shares = [Interval(*(max(x, _LOWEST) for x in result.share)) for result in mine]
            series.append(Series(name, [result.budget for result in mine], shares))
        panels.append(
            Panel(title, "rounds of play", "share, interquartile mean", [*series, top], "log")
        )
    return panels_figure(about, panels, "95% intervals", columns=3)
