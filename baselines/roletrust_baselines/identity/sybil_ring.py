"""The Sybil ring."""

from typing import Annotated, Any, ClassVar

from pydantic import NonNegativeInt, PositiveInt

from roletrust_baselines.coalition.ring import Ring
from roletrust_baselines.identity.turns import called
from roletrust_env.arrays import Array
from roletrust_env.game.policy import Channel
from roletrust_env.game.views import IdentityView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Identities, SearchRange, Share


@checked_dataclass
class SybilRing(Ring):
    """Sybil ring: an attacker with many identities that are a ring, whose raters lie together.

    After Douceur (2002), "The Sybil Attack". The identities that provide cheat while they are trusted. Those that rate
    lift them, sink the best of the other providers and are honest about the rest.

    Attributes:
        reserve: Number of identities in reserve that it takes besides its first one, 1 or more.
        every: Number of rounds between two identities; 0 calls all at once.
        threshold: Own ToP from which on a provider cheats, in [0, 1].
        bad: Quality of bad service, in [0, 1].
        cut: Rank down to which other providers are sunk, from 0, the best one only, to 1, all of them.
        sink: Share by which their ratings are reduced, in [0, 1].
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or published trust before the
            first; `"published"` is published trust.
        accomplices: Indices of the ring's providers among all providers. They are always rated 1 and have no rank.
            None is a ring without providers.
        start: First round of the attack, in which it calls its first identity in reserve.
        stop: First round after the attack; the identities stay. None attacks to the end.
    """

    reserve: Annotated[PositiveInt, Identities()] = 1
    every: Annotated[NonNegativeInt, SearchRange(0, 10), GridValues(0)] = 0
    threshold: Annotated[Share, GridValues(0.3, 0.7)] = 0.5
    cut: Annotated[Share, GridValues(0.4, 1.0)] = 0.4
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings", "presence"})

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the identities called until now. See `Policy.presence`."""
        return called(view, self.reserve, self.start, self.every), memory
