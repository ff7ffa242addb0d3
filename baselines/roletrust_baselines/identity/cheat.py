"""Base class of attacks by owners of several identities."""

from typing import Annotated, ClassVar

from pydantic import ConfigDict, PositiveInt

from roletrust_baselines.provider.on_off import OnOff
from roletrust_baselines.rater.bad_mouthing import BadMouthing
from roletrust_env.game.by_channel import ByChannel
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Identities


@checked_dataclass(config=ConfigDict(arbitrary_types_allowed=True))
class IdentityAttack(ByChannel):
    """Attacker that cheats in each of its identities, on the channels that the role of the identity has.

    Attributes:
        reserve: Number of identities in reserve that it takes besides its first one, 1 or more.
        serves: Policy by which each identity serves; by default the worst service in every round.
        rates: Policy by which each identity rates; by default the lowest rating for every provider.
    """

    reserve: Annotated[PositiveInt, Identities()] = 1
    serves: Policy = OnOff(duty=1.0)
    rates: Policy = BadMouthing(level=0.0)
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings", "presence"})
