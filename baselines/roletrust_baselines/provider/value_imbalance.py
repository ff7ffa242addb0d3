"""The value imbalance attack."""

from typing import Any

from pydantic.dataclasses import dataclass

from roletrust_baselines.provider.cheating import CheatingProvider
from roletrust_env.arrays import Array
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random
from roletrust_env.ranges import Share


@dataclass(frozen=True)
class ValueImbalance(CheatingProvider):
    """Value imbalance: a provider that is honest on cheap services and cheats on dear ones.

    Kerr and Cohen (2009), "Smart Cheaters Do Prosper". It needs a scenario with `values` that differ: where all are
    alike, every service is as dear as the dearest.

    Attributes:
        threshold: value of a service, as a share of the dearest, above which it cheats, in [0, 1].
        bad: quality of bad service, in [0, 1].
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    threshold: Share = 0.5

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Above the threshold. See `CheatingProvider.cheats`."""
        return view.value > self.threshold, memory
