"""What a coalition of raters does: its lies by the true places of the providers, and the trust that it keeps."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.evaluation.measurement import (
    HELD_OUT,
    TaskArguments,
    attacked_rollout,
    exact_task,
    random_sources,
)
from roletrust_env.world.roster import places
from roletrust_experiments.plots.style import ATTACKER, HONEST, INK, tidy

Floats = npt.NDArray[np.float64]


class Lies(NamedTuple):
    """Games of a coalition of raters among honest providers.

    Attributes:
        by_place: Mean lie about the provider at each true place, the best first, in each game, shape (P, G): the rating
            less the quality that the liar perceived.
        own: Mean ToR of the liars in each round, shape (T,).
        honest: The same of the honest raters.
    """

    by_place: Floats
    own: Floats
    honest: Floats


def watch_lies(arguments: TaskArguments, attacker: Attacker, games: int = 100, seed: int = 0) -> Lies:
    """Play held-out games of a coalition of raters and return its lies.

    Args:
        arguments: Arguments of the task.
        attacker: The coalition.
        games: Number of games.
        seed: Random seed.
    """
    task = exact_task(arguments)
    liars = places(task.compromised, task.game.roster.rater_names)
    honest = [k for k in range(task.game.roster.n_raters) if k not in liars]
    told, number, quality, trust = 0.0, 0.0, 0.0, []
    for played in attacked_rollout(task, attacker, (1, games), *random_sources(task, seed, HELD_OUT)):
        rated = played.state.rated[liars, :, 0]
        lies = np.where(rated, played.state.ratings[liars, :, 0] - played.before.service[liars, :, 0], 0.0)
        told, number = told + lies.sum(axis=0), number + rated.sum(axis=0)
        quality = quality + played.state.quality[:, 0]
        tor = task.game.published(played.state)[0][:, 0]
        trust.append((tor[liars].mean(), tor[honest].mean()))
    order = np.argsort(-np.asarray(quality), axis=0)
    own, other = np.array(trust).T
    return Lies(np.take_along_axis(np.asarray(told / number), order, axis=0), own, other)


def lies_figure(lies: Lies) -> Figure:
    """Return a figure of the lies by true place, with the range of four games out of five, and of the raters' trust.

    Args:
        lies: Games of a coalition.
    """
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    place = np.arange(1, len(lies.by_place) + 1)
    low, high = np.percentile(lies.by_place, [10, 90], axis=1)
    tidy(left, "rating less perceived quality")
    left.fill_between(place, low, high, color=ATTACKER, alpha=0.15, linewidth=0)
    left.plot(place, lies.by_place.mean(axis=1), color=ATTACKER, marker="o", linewidth=2)
    left.axhline(0, color=INK, linewidth=0.8)
    left.set_ylim(-1.05, 1.05)
    left.set_yticks([-1, -0.5, 0, 0.5, 1], ["-1", "", "0", "", "1"])
    left.xaxis.set_major_locator(MaxNLocator(integer=True))
    left.set_xlabel("true place of the provider, 1 is the best", color=INK)
    left.set_title("The lie", loc="left", fontsize=11, color=INK)
    tidy(right, "mean trust in raters (ToR)")
    right.plot(lies.own, color=ATTACKER, linewidth=2, label="liars")
    right.plot(lies.honest, color=HONEST[0], linewidth=2, linestyle="--", label="honest raters")
    right.set_xlabel("round", color=INK)
    right.set_title("The trust that it keeps", loc="left", fontsize=11, color=INK)
    right.legend(frameon=False, labelcolor=INK)
    return figure
