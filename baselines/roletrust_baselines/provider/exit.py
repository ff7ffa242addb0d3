"""The exit attack."""

from dataclasses import field
from typing import Annotated, Any

from pydantic import PositiveInt
from pydantic.dataclasses import dataclass

from roletrust_baselines.provider.cheating import CheatingProvider
from roletrust_env.arrays import Array
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GameLength, GridValues, SearchRange


@dataclass(frozen=True)
class Exit(CheatingProvider):
    """Exit: a provider that serves well up to the last rounds, and cheats in these.

    Who is about to leave has no trust to lose; with a new identity afterwards it is the re-entry of Kerr and Cohen
    (2009), "Smart Cheaters Do Prosper". It has to know when the game ends; the command line and the searches tell it.

    Attributes:
        length: of the game, in rounds.
        last: rounds before its end in which it cheats.
        bad: quality of bad service, in [0, 1].
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    length: Annotated[PositiveInt, GameLength()] = field(kw_only=True)
    last: Annotated[PositiveInt, SearchRange(1, 30), GridValues(1, 2, 5, 10, 20)] = 10

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """In the last rounds. See `CheatingProvider.cheats`."""
        return view.round >= self.length - self.last, memory
