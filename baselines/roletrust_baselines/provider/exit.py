"""The exit attack."""

from dataclasses import field
from typing import Annotated, Any

from pydantic import PositiveInt

from roletrust_baselines.provider.cheating import CheatingProvider
from roletrust_env.arrays import Array
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GameLength, GridValues, SearchRange


@checked_dataclass
class Exit(CheatingProvider):
    """Exit: a provider that serves well until the last rounds of the game, in which it cheats.

    A provider that is about to leave has no trust to lose. With a new identity afterwards, this is the re-entry of Kerr
    and Cohen (2009), "Smart Cheaters Do Prosper". The attack has to know the length of the game, which the command line
    and the searches fill in.

    Attributes:
        length: Length of the game, in rounds.
        last: Number of rounds at the end of the game in which it cheats.
        bad: Quality of bad service, in [0, 1].
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    length: Annotated[PositiveInt, GameLength()] = field(kw_only=True)
    last: Annotated[PositiveInt, SearchRange(1, 30), GridValues(1, 2, 5, 10, 20)] = 10

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether this is one of the last rounds. See `CheatingProvider.cheats`."""
        return view.round >= self.length - self.last, memory
