"""The whitewashing attack."""

from typing import Annotated, Any

from pydantic import ConfigDict

from roletrust_baselines.identity.cheat import IdentityAttack
from roletrust_baselines.identity.turns import renewed
from roletrust_env.arrays import Array
from roletrust_env.game.views import IdentityView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@checked_dataclass(config=ConfigDict(arbitrary_types_allowed=True))
class Whitewashing(IdentityAttack):
    """Whitewashing: an attacker that leaves when its trust is low, and comes back as a newcomer.

    After Friedman and Resnick (2001), "The Social Cost of Cheap Pseudonyms". When an identity has left or was cut off,
    the next one joins in the next round. The last identity stays, even with low trust.

    Attributes:
        reserve: Number of identities in reserve that it takes besides its first one, 1 or more. This is how often it
            can come back.
        serves: Policy by which each identity serves; by default the worst service in every round.
        rates: Policy by which each identity rates; by default the lowest rating for every provider.
        threshold: Trust below which an identity leaves, in [0, 1]. If it is above the trust of newcomers, an identity
            leaves in every round.
    """

    threshold: Annotated[Share, GridValues(0.2, 0.3, 0.4)] = 0.3

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the current identity, unless its trust is too low. See `Policy.presence`."""
        return renewed(view, self.reserve, self.threshold), memory
