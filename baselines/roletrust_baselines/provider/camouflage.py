"""The camouflage attack by services."""

from typing import Annotated, Any

from pydantic import NonNegativeInt
from pydantic.dataclasses import dataclass

from roletrust_baselines.provider.cheating import Cheating
from roletrust_env.arrays import Array
from roletrust_env.game.schedule import wake
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random
from roletrust_env.ranges import Searched, Share, Tried


@dataclass(frozen=True)
class Camouflage(Cheating):
    """Camouflage: a provider that serves well until it is trusted, and badly from then on.

    The sleeper of the unfair-rating literature (Irissappane, Jiang and Zhang 2012), here by services. With
    `wakes_at=0` it wakes by the clock alone, as `OnOff(start=..., duty=1)` does.

    Attributes:
        wakes_at: own ToP at which it starts to cheat, for good, in [0, 1].
        bad: quality of bad service, in [0, 1].
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    start: Annotated[NonNegativeInt, Searched(0, 100), Tried(0, 20, 50)] = 20
    wakes_at: Annotated[Share, Tried(0.0, 0.9)] = 0.8

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """From the first active round on in which its trust is high enough. See `Cheating.cheats`."""
        return wake(self.active(view.round) & (view.trust >= self.wakes_at), memory)
