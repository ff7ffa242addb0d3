"""The learning curve of a training run."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from roletrust_agents.learned import SavedAttacker
from roletrust_experiments.plots.style import ATTACKER, HONEST, INK, quiet


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
