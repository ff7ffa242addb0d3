"""The transitive lying attack."""

from typing import Annotated, Any, ClassVar

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@checked_dataclass
class TransitiveLying(TargetedLyingRater):
    """Transitive lying: an agent that is as honest as a rater as it is good as a provider.

    This is the transitive scenario of ATB (Jelenc et al. 2013), in which the trust in a provider also applies to it as
    a rater. As a provider the agent serves at its own quality. As a rater it is honest with a probability of this
    quality, drawn for each service, and rates the complement otherwise. A pure rater has such a quality, too.

    Attributes:
        own: Own quality, in [0, 1].
        targets: Indices of the victims among the providers; None lies about all of them.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    own: Annotated[Share, GridValues(0.0, 0.25, 0.5, 0.75)] = 0.25
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return its own quality while active, and 1 otherwise. See `Policy.quality`."""
        zero = 0 * view.trust
        return namespace(zero).where(self.active(view.round), zero + self.own, zero + 1), memory

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return honest ratings at random, and the complement otherwise. See `LyingRater.lies`."""
        honest = random.uniform(view.service.shape) < self.own
        return namespace(view.service).where(honest, view.service, 1 - view.service), memory
