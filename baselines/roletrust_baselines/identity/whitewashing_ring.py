"""The whitewashing ring."""

from typing import Annotated, Any, ClassVar

from pydantic import PositiveInt

from roletrust_baselines.coalition.ring import Ring
from roletrust_baselines.identity.turns import renewed
from roletrust_env.arrays import Array
from roletrust_env.game.policy import Channel
from roletrust_env.game.views import IdentityView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Identities, Share


@checked_dataclass
class WhitewashingRing(Ring):
    """Whitewashing ring: a ring whose agents come back as newcomers when their trust is low.

    After Friedman and Resnick (2001), "The Social Cost of Cheap Pseudonyms". The identities that provide cheat while
    they are trusted. Those that rate lift them, sink the best of the other providers and are honest about the rest. The
    last identity of an agent stays.

    Attributes:
        reserve: Number of identities in reserve that it takes besides its first one, 1 or more. This is how often it
            can come back.
        leaves_below: Trust below which an identity leaves, in [0, 1].
        threshold: Own ToP from which on a provider cheats, in [0, 1].
        bad: Quality of bad service, in [0, 1].
        cut: Rank down to which other providers are sunk, from 0, the best one only, to 1, all of them.
        sink: Share by which their ratings are reduced, in [0, 1].
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or published trust before the
            first; `"published"` is published trust.
        accomplices: Indices of the ring's providers among all providers. They are always rated 1 and have no rank.
            None is a ring without providers.
        start: First round of the attack.
        stop: First round after the attack; the agents still come back. None attacks to the end.
    """

    reserve: Annotated[PositiveInt, Identities()] = 1
    leaves_below: Annotated[Share, GridValues(0.3)] = 0.3
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings", "presence"})

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the current identity, unless its trust is too low. See `Policy.presence`."""
        return renewed(view, self.reserve, self.leaves_below), memory
