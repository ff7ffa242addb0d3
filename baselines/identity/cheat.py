"""What an owner of several identities does with each of them."""

from typing import Any, ClassVar

from pydantic import ConfigDict, PositiveInt
from pydantic.dataclasses import dataclass

from baselines.provider.on_off import OnOff
from baselines.rater.bad_mouthing import BadMouthing
from roletrust_env.arrays import Array
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.randomness import Random


@dataclass(frozen=True, config=ConfigDict(arbitrary_types_allowed=True))
class Cheat(Policy):
    """An attacker that cheats in each of its identities, as far as the identity's role has the channel.

    Attributes:
        reserve: identities in reserve that it takes beside its first, 1 or more.
        serves: how each of them serves; by default always as badly as can be.
        rates: how each of them rates; by default all as low as can be.
    """

    reserve: PositiveInt = 1
    serves: Policy = OnOff(duty=1.0)
    rates: Policy = BadMouthing(level=0.0)
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings", "presence"})

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """What the two remember. See `Policy.begin`."""
        return self.serves.begin(random, shape), self.rates.begin(random, shape)

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.quality`."""
        quality, mine = self.serves.quality(view, memory[0], random)
        return quality, (mine, memory[1])

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.ratings`."""
        ratings, mine = self.rates.ratings(view, memory[1], random)
        return ratings, (memory[0], mine)

    def withholds(self, view: RaterView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """See `Policy.withholds`."""
        withheld, mine = self.rates.withholds(view, memory[1], random)
        return withheld, (memory[0], mine)
