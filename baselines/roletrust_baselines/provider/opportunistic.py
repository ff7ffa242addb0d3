"""The opportunistic service attack."""

from typing import Annotated, Any

from roletrust_baselines.provider.cheating import CheatingProvider
from roletrust_env.arrays import Array
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@checked_dataclass
class Opportunistic(CheatingProvider):
    """Opportunistic service: a provider that serves well only while its own trust is low.

    Chen, Bao and Guo (2016), "Trust-Based Service Management for Social Internet of Things Systems": good service when
    its reputation drops, bad service when it is high. The paper gives no formula; the threshold is our interpretation.

    Attributes:
        threshold: Own ToP from which on it cheats, in [0, 1].
        bad: Quality of bad service, in [0, 1].
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    threshold: Annotated[Share, GridValues(0.3, 0.5, 0.7, 0.9)] = 0.7

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether its trust has reached the threshold. See `CheatingProvider.cheats`."""
        return view.trust >= self.threshold, memory
