"""What an attack takes from the honest, how long that lasts, and what it costs the attackers.

An attack is measured against a paired run: the same games with the same luck, in which everybody is honest.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.metrics.score import Floats, Score, mean_or_nan, numbers, ratio


class Worst(NamedTuple):
    """The attack that does most harm, and how much, the mean over games."""

    attack: str
    damage: float


def damage(trust: Floats, twin: Floats, agents: Sequence[int]) -> Score:
    """What an attack took: the mean trust of some agents without it, less their mean trust under it.

        damage = mean over rounds t and agents k of twin[t, k] - trust[t, k]

    Both are over the rounds in which an agent is present in either run. Where it is gone in one of them, such as cut
    off because of the attack, its last trust there counts; else the worst hit would drop out of the mean.

    Args:
        trust: under the attack, (T, N, ...), NaN where an agent is absent.
        twin: without it, of the same shape.
        agents: places of those whose trust counts: the honest ones, or the attackers for what they lost themselves.
    """
    difference = np.where(np.isnan(twin) & np.isnan(trust), np.nan, _held(twin) - _held(trust))[:, list(agents)]
    taken = mean_or_nan(difference, axis=(0, 1))
    return Score.where(~np.isnan(taken), taken, "none of the agents was ever there")


def recovery(trust: Floats, twin: Floats, agents: Sequence[int], stop: int, within: float = 0.05) -> Score:
    """Rounds from the end of an attack until the mean trust of some agents is back near that of the paired run.

        recovery = min {r >= 0: |mean over k of trust[stop + r, k] - mean over k of twin[stop + r, k]| <= within}

    Args:
        trust: under the attack, (T, N, ...), NaN where an agent is absent.
        twin: without it, of the same shape.
        agents: places of those whose trust counts.
        stop: first round after the attack.
        within: how near is back.

    Raises:
        ValueError: `stop` is no round of the game.
    """
    if not 0 <= stop < len(trust):
        raise ValueError(f"stop is {stop}; it must be a round of the game, from 0 to {len(trust) - 1}")
    after = mean_or_nan(trust[stop:, list(agents)], axis=1) - mean_or_nan(twin[stop:, list(agents)], axis=1)
    back = abs(after) <= within
    return Score.where(back.any(axis=0), back.argmax(axis=0), "trust was not back before the game was over")


def return_on_attack(gained: Score | npt.ArrayLike, lost: Score | npt.ArrayLike) -> Score:
    """What attackers gained for each unit of trust that they lost: damage done, or profit made, over trust lost.

        return = gained / lost

    Args:
        gained: the damage to the honest, or the attackers' profit beyond that of honest play: a score, or shape (...).
        lost: the mean trust that the attackers lost, likewise, see `damage`.
    """
    gain, price = numbers(gained), numbers(lost)
    known = (price > 0) & ~np.isnan(gain)
    return Score.where(known, ratio(gain, price), "the attackers lost no trust, or what they gained is undefined")


def exploitability(damages: Mapping[str, Score | npt.ArrayLike]) -> Worst:
    """The worst case over attacks, after RobustBench (Croce et al. 2021): the highest mean damage.

        exploitability = max over attacks of the mean over games of damage

    Args:
        damages: the damage by each attack, by name: a score, one number, or one for each game.

    Raises:
        ValueError: there is no attack, or one whose damage is undefined in every game.
    """
    if not damages:
        raise ValueError("damages is empty; there must be one attack at least")
    means = {attack: float(mean_or_nan(numbers(found).reshape(-1), 0)) for attack, found in damages.items()}
    for attack, mean in means.items():
        if np.isnan(mean):
            raise ValueError(f"the damage by {attack!r} is undefined in every game")
    worst = max(means, key=lambda attack: means[attack])
    return Worst(worst, means[worst])


def _held(trust: Floats) -> Floats:
    """Trust, (T, ...), in which who is gone keeps its last value; NaN before there is one."""
    rounds = np.arange(len(trust)).reshape(-1, *[1] * (trust.ndim - 1))
    last = np.maximum.accumulate(np.where(np.isnan(trust), 0, rounds), axis=0)
    held: Floats = np.take_along_axis(trust, last, axis=0)
    return held
