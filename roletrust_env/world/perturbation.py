"""Strength of the perturbations in each round."""

from collections.abc import Iterable

import numpy as np

from roletrust_env.arrays import Array, cast, is_compiling, namespace
from roletrust_env.world.scenario import Perturbation, Scenario


class Perturbations:
    """Perturbations of a scenario. Where several overlap, the strongest one counts.

    Args:
        scenario: Scenario with the perturbations.
        like: Array of the library, dtype and device to work with.
    """

    def __init__(self, scenario: Scenario, like: Array) -> None:
        xp = namespace(like)
        self._perturbations = sorted(scenario.perturbations, key=_strength)
        table = np.zeros(scenario.max_cycles)
        for perturbation in self._perturbations:
            table[perturbation.start : perturbation.stop] = perturbation.strength
        self._table = xp.asarray(table, dtype=like.dtype, device=like.device)

    def strength(self, round: Array) -> Array:
        """Return the strength in each round; rounds and strengths have the same shape (...)."""
        if not is_compiling(round):
            return self._table[round]
        now = cast(round, self._table.dtype)  # compared twice as fast as integers of 64 bits
        strength = 0.0 * now
        for perturbation in self._perturbations:
            active = (now >= perturbation.start) & (now < perturbation.stop)
            strength = namespace(now).where(active, perturbation.strength, strength)
        return strength


def strength_in(perturbations: Iterable[Perturbation], round: int) -> float:
    """Return the strength in one round, which may be beyond the length of the game."""
    return max(
        (one.strength for one in perturbations if one.start <= round < one.stop), default=0.0
    )


def _strength(perturbation: Perturbation) -> float:
    return perturbation.strength
