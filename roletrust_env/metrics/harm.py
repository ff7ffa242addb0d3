"""Metrics of harm: damage by an attack, its duration, and its cost to the attackers.

An attack is compared with a paired run: the same games with the same random numbers, in which all
agents are honest.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.metrics.score import (
    Floats,
    RoundWeights,
    Score,
    TrustByRound,
    as_numbers,
    mean_or_nan,
    ratio,
)


class WorstAttack(NamedTuple):
    """Attack with the highest damage, and this damage, the mean over games."""

    attack: str
    damage: float


def damage(
    trust: TrustByRound,
    paired: TrustByRound,
    agents: Sequence[int],
    weights: RoundWeights | None = None,
) -> Score:
    """Return the mean trust that an attack takes from some agents.

        damage = mean over rounds t and agents k of paired[t, k] - trust[t, k]

    The mean is over the rounds in which an agent is present in at least one of the two runs. If it
    is absent in the other one, for example cut off because of the attack, its last trust there
    counts. Otherwise the agents with most damage would drop out of the mean.

    Args:
        trust: Trust under the attack, shape (T, N, ...), NaN where an agent is absent.
        paired: Trust in the paired run, of the same shape.
        agents: Indices of the agents: the honest ones, or the attackers for the trust that they
            lost themselves.
        weights: Weights of the rounds, shape (T,), see `Scenario.round_weights`; None weights all
            alike.
    """
    absent = np.isnan(paired) & np.isnan(trust)
    difference = np.where(absent, np.nan, _fill_forward(paired) - _fill_forward(trust))[
        :, list(agents)
    ]
    loss = mean_or_nan(difference, (0, 1), weights)
    return Score.where(~np.isnan(loss), loss, "none of the agents was ever present")


def recovery(
    trust: TrustByRound,
    paired: TrustByRound,
    agents: Sequence[int],
    stop: int,
    within: float = 0.05,
) -> Score:
    """Return the number of rounds from the end of an attack until the mean trust of some agents has
    recovered.

        recovery = min {r >= 0: |mean over k of trust[stop + r, k] - mean over k of paired[stop + r,
                k]| <= within}

    Args:
        trust: Trust under the attack, shape (T, N, ...), NaN where an agent is absent.
        paired: Trust in the paired run, of the same shape.
        agents: Indices of the agents.
        stop: First round after the attack.
        within: Largest difference that counts as recovered.

    Raises:
        ValueError: `stop` is not a round of the game.
    """
    if not 0 <= stop < len(trust):
        raise ValueError(
            f"stop is {stop}; it must be a round of the game, from 0 to {len(trust) - 1}"
        )
    after = mean_or_nan(trust[stop:, list(agents)], axis=1) - mean_or_nan(
        paired[stop:, list(agents)], axis=1
    )
    recovered = abs(after) <= within
    return Score.where(
        recovered.any(axis=0),
        recovered.argmax(axis=0),
        "trust did not recover before the game ended",
    )


def return_on_attack(gained: Score | npt.ArrayLike, lost: Score | npt.ArrayLike) -> Score:
    """Return the gain of the attackers for each unit of trust that they lose.

        return = gained / lost

    Args:
        gained: Damage to the honest agents, or profit of the attackers beyond honest play: a score,
            or shape (...).
        lost: Mean trust that the attackers lost, see `damage`: a score, or shape (...).
    """
    gain, price = as_numbers(gained), as_numbers(lost)
    known = (price > 0) & ~np.isnan(gain)
    return Score.where(
        known, ratio(gain, price), "the attackers lost no trust, or their gain is undefined"
    )


def exploitability(damages: Mapping[str, Score | npt.ArrayLike]) -> WorstAttack:
    """Return the worst case over attacks, after RobustBench (Croce et al. 2021): the highest mean
    damage.

        exploitability = max over attacks of the mean over games of damage

    Args:
        damages: Damage of each attack, by name: a score, a single number, or one for each game.

    Raises:
        ValueError: There are no attacks, or the damage of an attack is undefined in every game.
    """
    if not damages:
        raise ValueError("damages is empty; there must be at least one attack")
    means = {
        attack: float(mean_or_nan(as_numbers(damage).reshape(-1), 0))
        for attack, damage in damages.items()
    }
    for attack, mean in means.items():
        if np.isnan(mean):
            raise ValueError(f"the damage by {attack!r} is undefined in every game")
    worst = max(means, key=lambda attack: means[attack])
    return WorstAttack(worst, means[worst])


def _fill_forward(trust: Floats) -> Floats:
    """Return trust of shape (T, ...) in which absent agents keep their last value; NaN before the
    first value.
    """
    rounds = np.arange(len(trust)).reshape(-1, *[1] * (trust.ndim - 1))
    last = np.maximum.accumulate(np.where(np.isnan(trust), 0, rounds), axis=0)
    filled: Floats = np.take_along_axis(trust, last, axis=0)
    return filled
