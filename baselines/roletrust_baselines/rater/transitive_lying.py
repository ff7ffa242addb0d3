"""The transitive lying attack."""

from typing import Annotated, Any, ClassVar

from pydantic.dataclasses import dataclass

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@dataclass(frozen=True)
class TransitiveLying(TargetedLyingRater):
    """Transitive lying: an agent that tells the truth as often as it serves well.

    The transitive scenario of ATB (Jelenc et al. 2013): who is trusted as a provider may be trusted as a rater, and who
    is not, not. As a provider it serves at its own quality; as a rater it tells the truth with that probability, drawn
    for each service, and else the complement. A rater that provides nothing has its quality all the same.

    Attributes:
        own: its own quality, in [0, 1].
        targets: places of the victims on the provider axis; None lies about all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    own: Annotated[Share, GridValues(0.0, 0.25, 0.5, 0.75)] = 0.25
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Its own quality while active, 1 otherwise. See `Policy.quality`."""
        zero = 0 * view.trust
        return namespace(zero).where(self.active(view.round), zero + self.own, zero + 1), memory

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """The truth now and then, else the complement. See `LyingRater.lies`."""
        honest = random.uniform(view.service.shape) < self.own
        return namespace(view.service).where(honest, view.service, 1 - view.service), memory
