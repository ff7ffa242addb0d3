"""What an owner of several identities does with each of them."""

from typing import Annotated, ClassVar

from pydantic import ConfigDict, PositiveInt
from pydantic.dataclasses import dataclass

from roletrust_baselines.provider.on_off import OnOff
from roletrust_baselines.rater.bad_mouthing import BadMouthing
from roletrust_env.game.by_channel import ByChannel
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.ranges import Identities


@dataclass(frozen=True, config=ConfigDict(arbitrary_types_allowed=True))
class IdentityAttack(ByChannel):
    """An attacker that cheats in each of its identities, as far as the identity's role has the channel.

    Attributes:
        reserve: identities in reserve that it takes beside its first, 1 or more.
        serves: how each of them serves; by default always as badly as can be.
        rates: how each of them rates; by default all as low as can be.
    """

    reserve: Annotated[PositiveInt, Identities()] = 1
    serves: Policy = OnOff(duty=1.0)
    rates: Policy = BadMouthing(level=0.0)
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings", "presence"})
