"""Scripted attacks by ratings."""

from dataclasses import field
from typing import Annotated, Any, ClassVar, Literal

from pydantic import NonNegativeInt, PositiveInt

from roletrust_baselines.agent_indices import AgentIndices, provider_mask
from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.game.policy import Channel, WindowedAttack, asleep, wake
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.parameters import (
    Accomplices,
    SearchRange,
    Share,
    Victims,
    checked_dataclass,
)
from roletrust_env.randomness import Random

LEAST_CLAIM = 0.01
"""Priority of a false rating without a service that is equal to published trust."""


@checked_dataclass
class ClaimingRater(WindowedAttack):
    """Rater that also sends its false ratings without a service, where reports are open."""

    attacks: ClassVar[frozenset[Channel]] = frozenset({"ratings"})

    def lies_about(self, view: RaterView, memory: Any) -> Array:
        """Return a mask of the providers that it lies about in this round, boolean, shape (P, ...)
        or (...).

        Args:
            view: View of the rater.
            memory: Memory after the ratings of this round.
        """
        raise NotImplementedError

    def claims(self, view: RaterView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """Return as the priority of each false rating its distance from published trust. See
        `Policy.claims`.
        """
        unserved = view._replace(service=view.published, awaiting=view.awaiting & False)
        ratings, _ = self.ratings(unserved, memory, random)
        xp, published = namespace(ratings), view.published
        priority = xp.clip(abs(ratings - published), LEAST_CLAIM, 1.0)
        return xp.where(self.lies_about(unserved, memory), priority, 0 * priority), memory


def imagined(view: RaterView) -> RaterView:
    """Return the view with published trust as the quality of services that were not received."""
    service = namespace(view.service).where(view.awaiting, view.service, view.published)
    return view._replace(service=service)


@checked_dataclass
class LyingRater(ClaimingRater):
    """Rater that lies about all providers in a time window."""

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return its false ratings of all providers, shape (P, ...), and its new memory."""
        raise NotImplementedError

    def about(self, view: RaterView) -> Array:
        """Return a mask of the providers that it lies about in this round, boolean, shape (P, ...)
        or (...).
        """
        return self.active(view.round)

    def lies_about(self, view: RaterView, memory: Any) -> Array:
        """See `ClaimingRater.lies_about`."""
        return self.about(view)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return false ratings while active, and honest ratings otherwise. See `Policy.ratings`."""
        view = imagined(view)
        lies, memory = self.lies(view, memory, random)
        return namespace(lies).where(self.about(view), lies, view.service), memory


@checked_dataclass
class TargetedLyingRater(LyingRater):
    """Rater that lies about chosen providers and is honest about the others.

    With targets, such an attack is discriminatory (Dellarocas 2000). Discrimination by providers is
    to serve chosen raters badly, see `Conflicting`.

    Attributes:
        targets: Indices of the victims among the providers; None lies about all of them.
    """

    targets: Annotated[AgentIndices | None, Victims()] = field(default=None, kw_only=True)

    def about(self, view: RaterView) -> Array:
        """Return a mask of the targets while active. See `LyingRater.about`."""
        active = self.active(view.round)
        return (
            active
            if self.targets is None
            else active & provider_mask(self.targets, view, "targets")
        )


@checked_dataclass
class BadMouthing(TargetedLyingRater):
    """Bad-mouthing attack (BMA): a rater that rates good services low.

    Su and Saint-Jore (EWSN 2023), section 3, Figure 4, with a constant rating of 0.5.

    Attributes:
        lie: Kind of lie: `"constant"` always rates `level`; `"relative"` rates (1 - level) *
            perceived quality.
        level: Rating of the constant lie, or share by which the relative lie reduces a rating; in
            [0, 1].
    """

    lie: Literal["constant", "relative"] = "constant"
    level: Share = 0.5

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the constant rating, or the reduced perceived quality. See `LyingRater.lies`."""
        return view.service * (
            1 - self.level
        ) if self.lie == "relative" else 0 * view.service + self.level, memory


@checked_dataclass
class BallotStuffing(LyingRater):
    """Ballot stuffing: a rater that rates its accomplices better than they are.

    Dellarocas (2000), "Immunizing Online Reputation Reporting Systems"; the formula v (1 - k) + k
    is the exaggerated praise of Yu and Singh (2003).

    Attributes:
        level: Share k of the distance to 1 that is added to a rating, in [0, 1].
        accomplices: Indices of the accomplices among the providers; None praises all.
    """

    level: Share = 1.0
    accomplices: Annotated[AgentIndices | None, Accomplices()] = None

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return praise of every provider. See `LyingRater.lies`."""
        return praise(view.service, self.level), memory

    def about(self, view: RaterView) -> Array:
        """Return a mask of the accomplices while active. See `LyingRater.about`."""
        active = self.active(view.round)
        if self.accomplices is None:
            return active
        return active & provider_mask(self.accomplices, view, "accomplices")


def praise(service: Array, level: float) -> Array:
    """Return ratings that are raised by a share of their distance to 1."""
    return service * (1 - level) + level


@checked_dataclass
class CamouflageRating(BadMouthing):
    """Camouflage: a sleeper, which is a rater that is honest until it is trusted, and bad-mouths
    from then on.

    Irissappane, Jiang and Zhang (2012), "Towards a Comprehensive Testbed to Evaluate the Robustness
    of Reputation Systems against Unfair Rating Attacks". With `wakes_at=0` it depends on the round
    only, like `BadMouthing(start=...)`.

    Attributes:
        wakes_at: Own ToR from which on it lies, permanently, in [0, 1].
        start: First round in which it can lie.
    """

    start: Annotated[NonNegativeInt, SearchRange(0, 100)] = 20
    wakes_at: Share = 0.8

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return that it is asleep. See `Policy.begin`."""
        return asleep(random, shape)

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the lies of `BadMouthing` once it is awake, and honest ratings before. See
        `LyingRater.lies`.
        """
        lies, _ = super().lies(view, None, random)
        awake, memory = wake(self.active(view.round) & (view.trust >= self.wakes_at), memory)
        return namespace(lies).where(awake, lies, view.service), memory

    def lies_about(self, view: RaterView, memory: Any) -> Array:
        """Return a mask of the targets once it is awake. See `ClaimingRater.lies_about`."""
        return self.about(view) & memory


@checked_dataclass
class Complementary(TargetedLyingRater):
    """Complementary ratings: a rater that rates good services as bad and bad ones as good.

    Yu and Singh (2003), "Detecting Deception in Reputation Management".
    """

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return 1 minus the perceived quality. See `LyingRater.lies`."""
        return 1 - view.service, memory


@checked_dataclass
class FlipFlop(TargetedLyingRater):
    """Flip-flop ratings: a rater that rates 1 and 0 in turn, whatever it perceives.

    It exploits the stability term of a model: the trust of the providers oscillates although their
    service does not. The attack is strongest if several raters play it in step.

    Attributes:
        period: Number of successive rounds with a rating of 1, followed by as many with a rating of
            0.
    """

    period: Annotated[PositiveInt, SearchRange(1, 12)] = 1

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return ratings of 1 and 0 in turn. See `LyingRater.lies`."""
        praises = (view.round - self.start) % (2 * self.period) < self.period
        return 0 * view.service + cast(praises, view.service.dtype), memory


@checked_dataclass
class Optimistic(TargetedLyingRater):
    """Optimistic ratings: a rater that halves the distance of each rating to the best, (x + 1) / 2
    on [-1, 1].

    The ratings are those of `BallotStuffing(level=0.5)`, but for honest providers, the targets.
    """

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the mean of the perceived quality and 1. See `LyingRater.lies`."""
        return (view.service + 1) / 2, memory


@checked_dataclass
class Pessimistic(TargetedLyingRater):
    """Pessimistic ratings: a rater that halves the distance of each rating to the worst, (x - 1) /
    2 on [-1, 1].

    The ratings are those of `BadMouthing(lie="relative", level=0.5)`. Searches vary the targets
    only.
    """

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return half the perceived quality. See `LyingRater.lies`."""
        return view.service / 2, memory


@checked_dataclass
class RandomRating(TargetedLyingRater):
    """Random ratings: a rater with ratings drawn from U[0, 1), which carry no information.

    This is the random scenario of ATB (Jelenc et al. 2013).
    """

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return random ratings. See `LyingRater.lies`."""
        return cast(random.uniform(view.service.shape), view.service.dtype), memory


@checked_dataclass
class RepTrap(TargetedLyingRater):
    """RepTrap: a rater that lies where a verdict is easily flipped, so that honest raters look like
    liars.

    Yang, Feng, Sun and Dai (2008), "RepTrap: A Novel Attack on Feedback-Based Reputation Systems".
    In the paper, the traps are objects with few ratings. A rater does not see the number of ratings
    in this game. In our interpretation, a trap is the target with the published trust nearest to
    0.5. The rater is honest about all other providers, which keeps its own trust high. It needs a
    service to lie about, and claims nothing.

    Attributes:
        traps: Number of providers that it lies about at a time.
    """

    traps: Annotated[PositiveInt, SearchRange(1, 5)] = 1

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the opposite verdict on the traps, 0 or 1, and honest ratings otherwise. See
        `LyingRater.lies`.
        """
        xp, service = namespace(view.service), view.service
        unsettled = xp.where(
            view.awaiting & self.about(view), abs(view.published - 0.5), 1 + 0 * service
        )
        trap = xp.argsort(xp.argsort(unsettled, axis=0, stable=True), axis=0) < self.traps
        return xp.where(trap, cast(service < 0.5, service.dtype), service), memory

    def lies_about(self, view: RaterView, memory: Any) -> Array:
        """Return a mask of the services that it may lie about. See `ClaimingRater.lies_about`."""
        return view.awaiting & self.about(view)


@checked_dataclass
class Silent(WindowedAttack):
    """Silence: a rater that uses services but withholds its ratings, of all providers or of chosen
    ones.

    A reputation system collects, distributes and aggregates feedback (Resnick et al. 2000,
    "Reputation Systems"), so it learns nothing from ratings that are not sent. Silence as an attack
    is not from a paper.

    Attributes:
        targets: Indices of the providers that it does not rate; None rates no provider.
    """

    targets: Annotated[AgentIndices | None, Victims()] = None
    attacks: ClassVar[frozenset[Channel]] = frozenset({"silence"})

    def withholds(self, view: RaterView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """Return a mask of the ratings that it withholds while active: all, or the targets. See
        `Policy.withholds`.
        """
        due = view.awaiting & self.active(view.round)
        return due if self.targets is None else due & provider_mask(
            self.targets, view, "targets"
        ), memory


@checked_dataclass
class TransitiveLying(TargetedLyingRater):
    """Transitive lying: an agent that is as honest as a rater as it is good as a provider.

    This is the transitive scenario of ATB (Jelenc et al. 2013), in which the trust in a provider
    also applies to it as a rater. As a provider the agent serves at its own quality. As a rater it
    is honest with a probability of this quality, drawn for each service, and rates the complement
    otherwise. A pure rater has such a quality, too.

    Attributes:
        own: Own quality, in [0, 1].
    """

    own: Share = 0.25
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return its own quality while active, and 1 otherwise. See `Policy.quality`."""
        zero = 0 * view.trust
        return namespace(zero).where(self.active(view.round), zero + self.own, zero + 1), memory

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return honest ratings at random, and the complement otherwise. See `LyingRater.lies`."""
        honest = random.uniform(view.service.shape) < self.own
        return namespace(view.service).where(honest, view.service, 1 - view.service), memory
