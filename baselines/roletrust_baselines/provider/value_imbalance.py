"""The value imbalance attack."""

from typing import Any

from roletrust_baselines.provider.cheating import CheatingProvider
from roletrust_env.arrays import Array
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import Share


@checked_dataclass
class ValueImbalance(CheatingProvider):
    """Value imbalance: a provider that is honest on cheap services and cheats on expensive ones.

    Kerr and Cohen (2009), "Smart Cheaters Do Prosper". It needs a scenario with different `values`. If all services
    have the same value, each of them counts as expensive.

    Attributes:
        threshold: Value of a service, as a share of the highest value, above which it cheats, in [0, 1].
        bad: Quality of bad service, in [0, 1].
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    threshold: Share = 0.5

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether the value is above the threshold. See `CheatingProvider.cheats`."""
        return view.value > self.threshold, memory
