"""The Sybil attack."""

from typing import Annotated, Any

from pydantic import ConfigDict, NonNegativeInt

from roletrust_baselines.identity.cheat import IdentityAttack
from roletrust_baselines.identity.turns import called
from roletrust_env.arrays import Array
from roletrust_env.game.views import IdentityView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange


@checked_dataclass(config=ConfigDict(arbitrary_types_allowed=True))
class Sybil(IdentityAttack):
    """Sybil attack: an attacker with many identities, which can outnumber the honest agents.

    After Douceur (2002), "The Sybil Attack". For camouflage, give `serves` and `rates` a `start` later than this one.

    Attributes:
        reserve: Number of identities in reserve that it takes besides its first one, 1 or more.
        serves: Policy by which each identity serves; by default the worst service in every round.
        rates: Policy by which each identity rates; by default the lowest rating for every provider.
        start: Round in which it calls its first identity in reserve, which is present after this round.
        every: Number of rounds between two identities; 0 calls all at once.
    """

    start: Annotated[NonNegativeInt, SearchRange(0, 100), GridValues(0, 50)] = 0
    every: Annotated[NonNegativeInt, SearchRange(0, 10), GridValues(0, 3)] = 0

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the identities called until now: all at once, or one after the other. See `Policy.presence`."""
        return called(view, self.reserve, self.start, self.every), memory
