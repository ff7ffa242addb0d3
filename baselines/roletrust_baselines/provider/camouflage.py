"""The camouflage attack by services."""

from typing import Annotated, Any

from pydantic import NonNegativeInt

from roletrust_baselines.provider.cheating import CheatingProvider
from roletrust_env.arrays import Array
from roletrust_env.game.schedule import asleep, wake
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange, Share


@checked_dataclass
class Camouflage(CheatingProvider):
    """Camouflage: a provider that serves well until it is trusted, and badly from then on.

    This is the sleeper of the literature on unfair ratings (Irissappane, Jiang and Zhang 2012), applied to services.
    With `wakes_at=0` it depends on the round only, like `OnOff(start=..., duty=1)`.

    Attributes:
        wakes_at: Own ToP from which on it cheats, permanently, in [0, 1].
        bad: Quality of bad service, in [0, 1].
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    start: Annotated[NonNegativeInt, SearchRange(0, 100), GridValues(0, 20, 50)] = 20
    wakes_at: Annotated[Share, GridValues(0.0, 0.9)] = 0.8

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return that it is asleep. See `Policy.begin`."""
        return asleep(random, shape)

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether its trust has been high enough in an active round. See `CheatingProvider.cheats`."""
        return wake(self.active(view.round) & (view.trust >= self.wakes_at), memory)
