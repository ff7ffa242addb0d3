"""The Sybil attack."""

from typing import Annotated, Any

from pydantic import ConfigDict, NonNegativeInt
from pydantic.dataclasses import dataclass

from roletrust_baselines.identity.cheat import IdentityAttack
from roletrust_env.arrays import Array
from roletrust_env.game.views import IdentityView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange


@dataclass(frozen=True, config=ConfigDict(arbitrary_types_allowed=True))
class Sybil(IdentityAttack):
    """Sybil attack: one attacker under many identities, which may outnumber the honest agents.

    After Douceur (2002), "The Sybil Attack". For camouflage give `serves` and `rates` a `start` later than this one's.

    Attributes:
        reserve: identities in reserve that it takes beside its first, 1 or more.
        serves: how each of them serves; by default always as badly as can be.
        rates: how each of them rates; by default all as low as can be.
        start: round in which the first of them is called; it is there after the round.
        every: rounds from one to the next; 0 calls all at once.
    """

    start: Annotated[NonNegativeInt, SearchRange(0, 100), GridValues(0, 50)] = 0
    every: Annotated[NonNegativeInt, SearchRange(0, 10), GridValues(0, 3)] = 0

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """All at once or in a wave, and for good. See `Policy.presence`."""
        called = (view.turn <= self.reserve) & (view.round >= self.start + (view.turn - 1) * self.every)
        return (view.turn == 0) | called, memory
