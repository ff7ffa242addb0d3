"""The self-promotion attack."""

from dataclasses import field
from typing import Annotated, Any, ClassVar

from roletrust_baselines.agent_indices import AgentIndices, provider_mask
from roletrust_baselines.rater.ballot_stuffing import praise
from roletrust_baselines.rater.lying import LyingRater
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import Accomplices, GridValues, Share


@checked_dataclass
class SelfPromotion(LyingRater):
    """Self-promotion: a ring whose providers serve badly, and whose raters praise them and are honest otherwise.

    Hoffman, Zage and Nita-Rotaru (2009), "A Survey of Attack and Defense Techniques for Reputation Systems". No agent
    rates itself in this game, so the attack needs two agents: assign it to the raters and the providers of the ring.

    Attributes:
        accomplices: Indices of the providers of the ring among all providers.
        bad: Quality of their services, in [0, 1].
        lift: Share of the distance to 1 that is added to a rating of the ring's providers, in [0, 1].
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    accomplices: Annotated[AgentIndices, Accomplices()] = field(kw_only=True)
    bad: Annotated[Share, GridValues(0.0, 0.5)] = 0.0
    lift: Annotated[Share, GridValues(0.5, 1.0)] = 1.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad quality while active, and 1 otherwise. See `Policy.quality`."""
        zero = 0 * view.trust
        return namespace(zero).where(self.active(view.round), zero + self.bad, zero + 1), memory

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return praise of the accomplices, and `of_others` for the others. See `LyingRater.lies`."""
        own = provider_mask(self.accomplices, view, "accomplices")
        praised = praise(view.service, self.lift)
        return namespace(praised).where(own, praised, self.of_others(view)), memory

    def of_others(self, view: RaterView) -> Array:
        """Return the ratings of providers outside the ring, shape (P, ...): the perceived quality."""
        return view.service
