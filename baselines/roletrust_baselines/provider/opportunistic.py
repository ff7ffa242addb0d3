"""The opportunistic service attack."""

from typing import Annotated, Any

from pydantic.dataclasses import dataclass

from roletrust_baselines.provider.cheating import CheatingProvider
from roletrust_env.arrays import Array
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@dataclass(frozen=True)
class Opportunistic(CheatingProvider):
    """Opportunistic service: a provider that serves well only while its own trust is low.

    Chen, Bao and Guo (2016), "Trust-Based Service Management for Social Internet of Things Systems": good service when
    its reputation drops, bad service when it is high. The threshold is a reading; there the attack has no formula.

    Attributes:
        threshold: own ToP from which on it cheats, in [0, 1].
        bad: quality of bad service, in [0, 1].
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    threshold: Annotated[Share, GridValues(0.3, 0.5, 0.7, 0.9)] = 0.7

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """From the threshold on. See `CheatingProvider.cheats`."""
        return view.trust >= self.threshold, memory
