"""The self-promotion attack."""

from dataclasses import field
from typing import Annotated, Any, ClassVar

from pydantic.dataclasses import dataclass

from roletrust_baselines.agent_indices import AgentIndices, index_mask
from roletrust_baselines.rater.ballot_stuffing import praise
from roletrust_baselines.rater.lying import LyingRater
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import Accomplices, GridValues, Share


@dataclass(frozen=True)
class SelfPromotion(LyingRater):
    """Self-promotion: a ring whose providers serve badly, and whose raters praise them and tell the truth otherwise.

    Hoffman, Zage and Nita-Rotaru (2009), "A Survey of Attack and Defense Techniques for Reputation Systems". Nobody
    rates itself in this game, so it takes two: seat it at the raters and at the providers of the ring alike.

    Attributes:
        accomplices: places of the ring's providers on the provider axis.
        bad: quality of their services, in [0, 1].
        lift: share of what a note of them lacks to 1 that is added, in [0, 1].
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    accomplices: Annotated[AgentIndices, Accomplices()] = field(kw_only=True)
    bad: Annotated[Share, GridValues(0.0, 0.5)] = 0.0
    lift: Annotated[Share, GridValues(0.5, 1.0)] = 1.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Bad while active, 1 otherwise. See `Policy.quality`."""
        zero = 0 * view.trust
        return namespace(zero).where(self.active(view.round), zero + self.bad, zero + 1), memory

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Praise of the accomplices, of the others what they get. See `LyingRater.lies`."""
        own = index_mask(self.accomplices, view.service, "accomplices")
        praised = praise(view.service, self.lift)
        return namespace(praised).where(own, praised, self.of_others(view)), memory

    def of_others(self, view: RaterView) -> Array:
        """What those who do not belong to the ring are rated, (P, ...)."""
        return view.service
