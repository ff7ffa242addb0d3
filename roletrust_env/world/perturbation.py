"""How strongly services are perturbed, and when."""

import numpy as np

from roletrust_env.arrays import Array, cast, compiling, namespace
from roletrust_env.world.scenario import Perturbation, Scenario


class Perturbations:
    """The perturbations of a scenario; where several overlap, the strongest counts.

    Args:
        scenario: whose perturbations they are.
        like: an array of the library, dtype and device to work with.
    """

    def __init__(self, scenario: Scenario, like: Array) -> None:
        xp = namespace(like)
        self._blows = sorted(scenario.perturbations, key=_strength)
        table = np.zeros(scenario.max_cycles)
        for blow in self._blows:
            table[blow.start : blow.stop] = blow.strength
        self._table = xp.asarray(table, dtype=like.dtype, device=like.device)

    def strength(self, round: Array) -> Array:
        """The strength in a round, both of shape (...)."""
        if not compiling(round):
            return self._table[round]
        now = cast(round, self._table.dtype)  # compared twice as fast as integers of 64 bits
        strength = 0.0 * now
        for blow in self._blows:
            strength = namespace(now).where((now >= blow.start) & (now < blow.stop), blow.strength, strength)
        return strength


def _strength(blow: Perturbation) -> float:
    return blow.strength
