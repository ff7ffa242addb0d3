"""Scripted attacks by ratings of coalitions, whose raters agree without messages."""

from dataclasses import field
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

from pydantic import Field, NonNegativeInt, PositiveInt

from roletrust_baselines.agent_indices import AgentIndices, index_mask, provider_mask
from roletrust_baselines.rater import ClaimingRater, LyingRater, praise
from roletrust_env.arrays import Array, cast, mean_places, namespace
from roletrust_env.game.policy import Channel, asleep, wake
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.parameters import (
    Accomplices,
    SearchRange,
    Share,
    checked_dataclass,
)
from roletrust_env.randomness import Random

STEPS = 1e6
"""Number of steps of [0, 1] that ranks tell apart, so that the rounding of means does not order
equal providers."""


class Estimates(NamedTuple):
    """Memory of a rater: its running mean of the perceived quality of each provider.

    Attributes:
        total: Sum of the perceived qualities, shape (P, ...).
        count: Number of perceived services, shape (P, ...).
    """

    total: Array
    count: Array

    @classmethod
    def nothing(cls, random: Random, shape: tuple[int, ...]) -> Self:
        """Return the memory before the first service.

        The number of providers is not known yet. Its axis has the length 1, which also suits the
        reset of single games of a batch.

        Args:
            random: Random numbers with the array library, dtype and device of the game; none is
                drawn.
            shape: Shape of the agents and the batch.
        """
        like = random.like
        nothing = namespace(like).zeros((1, *shape), dtype=like.dtype, device=like.device)
        return cls(nothing, nothing)

    def after(self, view: RaterView) -> Self:
        """Return the memory with the services that await a rating."""
        perceived = cast(view.awaiting, view.service.dtype)
        return type(self)(self.total + perceived * view.service, self.count + perceived)

    def means(self, unknown: Array) -> Array:
        """Return the mean perceived quality of each provider; `unknown` where nothing was
        perceived.
        """
        known = self.count > 0
        return namespace(unknown).where(known, self.total / (self.count + ~known), unknown)


def ranks(values: Array, left_out: Array | None = None) -> Array:
    """Return the ranks of the providers, 0 for the highest value and 1 for the lowest. Equal values
    share a mean rank.

    Args:
        values: Values in [0, 1], shape (P, ...).
        left_out: Mask of the providers that are not ranked, shape (P, 1 ...); their rank is 1.

    Example:
        >>> import numpy as np
        >>> ranks(np.array([0.5, 0.9, 0.2, 0.9, 0.7]))
        array([0.75 , 0.125, 1.   , 0.125, 0.5  ])
    """
    xp = namespace(values)
    ranked, steps = values.shape[0], xp.round(values * STEPS)
    if left_out is not None:
        ranked, steps = ranked - int(left_out.sum()), xp.where(left_out, 0 * steps - 1, steps)
    return xp.clip(mean_places(steps) / max(ranked - 1, 1), 0, 1)


@checked_dataclass
class AgreeingRater(ClaimingRater):
    """Rater of a coalition that lies about each provider by its rank.

    Raters need no messages to agree: all of them see the same published trust, and the means of
    their perceptions come closer to each other with every service.

    They have no noise of their own, also outside the attack: in place of its last perception, a
    rater reports the mean of all its perceptions of a provider. It looks more consistent than an
    honest rater.

    Attributes:
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or
            published trust before the first; `"published"` is published trust.
        accomplices: Indices of the accomplices among the providers. They are always rated 1 and
            have no rank. None is a coalition without accomplices.
    """

    by: Literal["perceived", "published"] = "perceived"
    accomplices: Annotated[AgentIndices | None, Accomplices()] = None

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return its false ratings of all providers, shape (P, ...).

        Args:
            estimates: Mean perceived quality of the providers, shape (P, ...).
            ranks: Their ranks from 0, the best, to 1, shape (P, ...). Ranks of accomplices have no
                meaning.
        """
        raise NotImplementedError

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return a memory without perceptions. See `Policy.begin`."""
        return Estimates.nothing(random, shape)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return false ratings while active, and its estimates otherwise. See `Policy.ratings`."""
        memory = memory.after(view)
        return self.reports(view, memory, self.active(view.round)), memory

    def reports(self, view: RaterView, estimates: Estimates, lying: Array) -> Array:
        """Return false ratings where the rater lies, and its estimates elsewhere.

        Args:
            view: View of the rater.
            estimates: Estimates after the services of this round.
            lying: Whether the rater lies, boolean, shape (...).
        """
        means = estimates.means(view.published)
        mine = self._accomplice(means)
        xp = namespace(means)
        lies = self.lies(means, ranks(means if self.by == "perceived" else view.published, mine))
        if mine is not None:
            lies = xp.where(mine, 0 * means + 1, lies)
        return xp.where(lying, lies, means)

    def estimates(self, memory: Any) -> Estimates:
        """Return the estimates in its memory."""
        estimates: Estimates = memory
        return estimates

    def lies_about(self, view: RaterView, memory: Any) -> Array:
        """Return a mask of the accomplices, and of the others that it is not honest about. See
        `ClaimingRater.lies_about`.
        """
        active, estimates = self.active(view.round), self.estimates(memory)
        means = estimates.means(view.published)
        mine = self._accomplice(means)
        about = self.reports(view, estimates, active) != means
        return about if mine is None else active & (about | mine)

    def _accomplice(self, rows: Array) -> Array | None:
        """Return a mask of the accomplices, boolean, shape (P, 1 ...); None without any."""
        if self.accomplices is None:
            return None
        return index_mask(self.accomplices, rows, "accomplices")


@checked_dataclass
class RankLies(AgreeingRater):
    """Lies by rank: raters that agree on a rating for each rank, by default the worst provider's is
    the highest.

    After Mukherjee, Liu and Glance (2012), "Spotting Fake Reviewer Groups in Consumer Reviews":
    groups of reviewers work together to promote or to demote targets. The curve from rank to rating
    is our choice. Complementary ratings bring the means of all providers closer together; these
    ratings turn their order around.

    Attributes:
        best: Rating of the best provider, in [0, 1].
        worst: Rating of the worst provider, in [0, 1].
        bend: Exponent of the rank in the curve between them, in (0, 8]. Above 1 only the worst
            providers are praised.
    """

    best: Share = 0.0
    worst: Share = 1.0
    bend: Annotated[float, Field(gt=0, le=8), SearchRange(0.25, 4)] = 2.0

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return the rating of each rank. See `AgreeingRater.lies`."""
        return self.best + (self.worst - self.best) * ranks**self.bend


@checked_dataclass
class SelfPromotion(LyingRater):
    """Self-promotion: a ring whose providers serve badly, and whose raters praise them and are
    honest otherwise.

    Hoffman, Zage and Nita-Rotaru (2009), "A Survey of Attack and Defense Techniques for Reputation
    Systems". No agent rates itself in this game, so the attack needs two agents: assign it to the
    raters and the providers of the ring.

    Attributes:
        accomplices: Indices of the providers of the ring among all providers.
        bad: Quality of their services, in [0, 1].
        lift: Share of the distance to 1 that is added to a rating of the ring's providers, in [0,
            1].
    """

    accomplices: Annotated[AgentIndices, Accomplices()] = field(kw_only=True)
    bad: Share = 0.0
    lift: Share = 1.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad quality while active, and 1 otherwise. See `Policy.quality`."""
        zero = 0 * view.trust
        return namespace(zero).where(self.active(view.round), zero + self.bad, zero + 1), memory

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return praise of the accomplices, and `of_others` for the others. See
        `LyingRater.lies`.
        """
        own = self.own(view)
        praised = praise(view.service, self.lift)
        return namespace(praised).where(own, praised, self.of_others(view)), memory

    def own(self, view: RaterView) -> Array:
        """Return a mask of the accomplices, boolean, shape (P, 1 ...)."""
        return provider_mask(self.accomplices, view, "accomplices")

    def of_others(self, view: RaterView) -> Array:
        """Return the ratings of providers outside the ring, shape (P, ...): the perceived
        quality.
        """
        return view.service

    def lies_about(self, view: RaterView, memory: Any) -> Array:
        """Return a mask of the accomplices while active. See `ClaimingRater.lies_about`."""
        return self.active(view.round) & self.own(view)


@checked_dataclass
class Collusion(SelfPromotion):
    """Collusion: a ring whose providers serve badly, and whose raters praise them and bad-mouth all
    others.

    The ring combines ballot stuffing and bad-mouthing, as in Hoffman, Zage and Nita-Rotaru (2009).

    Attributes:
        sink: Share by which a rating of the other providers is reduced, in [0, 1].
    """

    sink: Share = 1.0

    def of_others(self, view: RaterView) -> Array:
        """Return reduced ratings of the other providers. See `SelfPromotion.of_others`."""
        return view.service * (1 - self.sink)

    def lies_about(self, view: RaterView, memory: Any) -> Array:
        """Return whether it is active. See `ClaimingRater.lies_about`."""
        return self.active(view.round)


@checked_dataclass
class Orchestrated(Collusion):
    """Orchestrated attack: a ring of teams that attack in turn, while the other teams repair their
    trust.

    This is the oscillation attack of Hoffman, Zage and Nita-Rotaru (2009). The team in turn
    colludes. The other teams serve well and rate outsiders honestly, but still praise the providers
    of the ring. Each agent has the number of its team as a parameter.

    Attributes:
        teams: Number of teams.
        team: Number of the agent's team, from 0 on.
        turn: Number of rounds for which a team attacks.
        bad: Quality of service of the attacking team, in [0, 1].
        sink: Share by which the attacking team reduces a rating of the other providers, in [0, 1].
    """

    teams: PositiveInt = 2
    team: Annotated[NonNegativeInt, SearchRange(0, 1)] = 0
    turn: Annotated[PositiveInt, SearchRange(1, 12)] = 5

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad quality while its team attacks, and 1 otherwise. See `Policy.quality`."""
        bad, memory = super().quality(view, memory, random)
        return namespace(bad).where(self._in_turn(view.round), bad, 0 * bad + 1), memory

    def of_others(self, view: RaterView) -> Array:
        """Return reduced ratings while its team attacks, and honest ratings otherwise."""
        reduced = super().of_others(view)
        return namespace(reduced).where(self._in_turn(view.round), reduced, view.service)

    def lies_about(self, view: RaterView, memory: Any) -> Array:
        """Return a mask of the accomplices, and of all providers while its team attacks. See
        `ClaimingRater.lies_about`.
        """
        return super().lies_about(view, memory) & (self.own(view) | self._in_turn(view.round))

    def _in_turn(self, round: Array) -> Array:
        return ((round - self.start) // self.turn) % self.teams == self.team % self.teams


@checked_dataclass
class Promotion(AgreeingRater):
    """Promotion: raters that lift one mediocre honest provider above all better ones, and are
    honest about the rest.

    After the push and nuke attacks on recommender systems of O'Mahony et al. (2004), "Collaborative
    Recommendation: A Robustness Analysis", which promote and demote items. A lie about few
    providers costs the raters little trust.

    Attributes:
        place: Rank of the promoted provider from 0, the best, to 1. It is the provider with the
            nearest rank, the better one of two.
        lift: Share of the distance to 1 that is added to its rating, in [0, 1].
        sink: Share by which ratings of better providers are reduced, in [0, 1].
    """

    place: Share = 0.4
    lift: Share = 1.0
    sink: Share = 1.0

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return raised, reduced and honest ratings by rank. See `AgreeingRater.lies`."""
        xp = namespace(ranks)
        distance = (
            xp.round(abs(ranks - self.place) * STEPS) + ranks / 2
        )  # whole steps, and the better one of two
        promoted = distance == xp.min(distance, axis=0, keepdims=True)
        better = ranks < xp.min(xp.where(promoted, ranks, 1 + 0 * ranks), axis=0)
        lies = xp.where(better, estimates * (1 - self.sink), estimates)
        return xp.where(promoted, estimates * (1 - self.lift) + self.lift, lies)


@checked_dataclass
class SwapEnds(AgreeingRater):
    """Swap of the ends: raters that sink the best provider and lift the worst, and are honest about
    the rest.

    `RankLies` lies about all providers, and `Promotion` about all that are better than one. These
    raters lie about two providers, however many there are. If two are equally good, neither is the
    best or the worst. This attack is not from a paper.

    Attributes:
        sink: Share by which the rating of the best provider is reduced, in [0, 1].
        lift: Share of the distance to 1 that is added to the rating of the worst provider, in [0,
            1].
    """

    sink: Share = 1.0
    lift: Share = 1.0

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return the ratings with those of the ends reduced and raised. See
        `AgreeingRater.lies`.
        """
        xp = namespace(ranks)
        lies = xp.where(ranks == 1, estimates * (1 - self.lift) + self.lift, estimates)
        return xp.where(ranks == 0, estimates * (1 - self.sink), lies)


@checked_dataclass
class ShiftedLies(AgreeingRater):
    """Shifted lies: raters that lower the ratings of the best providers and raise all others, each
    by no more than a small amount.

    A trust model that blocks raters, or weights them by their distance from the judge's own
    experience, has a tolerance for noise. Lies within it are believed, and can still turn the order
    of the providers around. With `place=0` no provider is lowered. This attack is not from a paper.

    Attributes:
        shift: Largest change of a rating, in [0, 1].
        place: Rank down to which ratings are lowered, from 0, none, to 1, all but the worst one.
    """

    shift: Annotated[Share, SearchRange(0.05, 0.6)] = 0.25
    place: Share = 0.4

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return lowered and raised ratings by rank. See `AgreeingRater.lies`."""
        xp = namespace(ranks)
        signs = xp.where(ranks < self.place, 0 * ranks - 1, 0 * ranks + 1)
        return xp.clip(estimates + self.shift * signs, 0, 1)


@checked_dataclass
class SlanderUnmet(AgreeingRater):
    """Slander of the unmet: raters that give the lowest rating to all providers that they have not
    met, and are honest about the rest.

    The honest ratings agree with those of others, so that a trust model that compares raters with
    each other believes them. The attack needs open reports. It is not from a paper.

    Attributes:
        low: Rating of the providers that the rater has not met, in [0, 1].
    """

    low: Share = 0.0

    def reports(self, view: RaterView, estimates: Estimates, lying: Array) -> Array:
        """Return the low rating of the providers without a service. See `AgreeingRater.reports`."""
        means = estimates.means(view.published)
        xp, mine = namespace(means), self._accomplice(means)
        lies = xp.where(estimates.count > 0, means, 0 * means + self.low)
        if mine is not None:
            lies = xp.where(mine, 0 * means + 1, lies)
        return xp.where(lying, lies, means)


@checked_dataclass
class Sleeper(RankLies):
    """Sleepers: raters that are honest until they are trusted, and lie by rank together from then
    on.

    The camouflage attack of Irissappane, Jiang and Zhang (2012) by a coalition. Sleepers have no
    noise of their own, so that they are trusted more than honest raters when they wake up.

    Attributes:
        wakes_at: Own ToR from which on a rater lies, permanently, in [0, 1]. With 0 it wakes up at
            the start.
        start: First round in which a rater can wake up.
    """

    start: Annotated[NonNegativeInt, SearchRange(0, 100)] = 5
    wakes_at: Share = 0.7

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return a memory without perceptions, asleep. See `Policy.begin`."""
        return super().begin(random, shape), asleep(random, shape)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return false ratings once it is awake, and its estimates before. See `Policy.ratings`."""
        estimates = memory[0].after(view)
        awake, woken = wake(self.active(view.round) & (view.trust >= self.wakes_at), memory[1])
        lying = awake if self.stop is None else awake & (view.round < self.stop)
        return self.reports(view, estimates, lying), (estimates, woken)

    def estimates(self, memory: Any) -> Estimates:
        """See `AgreeingRater.estimates`."""
        return super().estimates(memory[0])

    def lies_about(self, view: RaterView, memory: Any) -> Array:
        """Return a mask of the lies once it is awake. See `AgreeingRater.lies_about`."""
        return super().lies_about(view, memory) & memory[1]


@checked_dataclass
class ReviewBurst(Promotion):
    """Review bursts: raters that promote a mediocre provider at the same time, for a few rounds of
    every period.

    Spammers often review together in bursts: Fei et al. (2013), "Exploiting Burstiness in Reviews
    for Review Spammer Detection". Between two bursts the raters are honest and repair their trust.
    The rule of the lies is our choice.

    Attributes:
        burst: Number of rounds of lies at the beginning of each period.
        every: Number of rounds of a period.
    """

    place: Share = 0.3
    burst: Annotated[PositiveInt, SearchRange(1, 12)] = 4
    every: Annotated[PositiveInt, SearchRange(1, 24)] = 6

    def active(self, round: Array) -> Array:
        """Return whether a burst is going on. See `WindowedAttack.active`."""
        return super().active(round) & ((round - self.start) % self.every < self.burst)
