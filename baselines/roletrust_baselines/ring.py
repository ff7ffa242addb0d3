"""Scripted attacks by rings: coalitions whose providers cheat while their raters praise them."""

from dataclasses import field
from typing import Annotated, Any, ClassVar

from pydantic import NonNegativeInt, PositiveInt

from roletrust_baselines.agent_indices import AgentIndices, index_mask
from roletrust_baselines.coalition import AgreeingRater, Estimates
from roletrust_baselines.rater import praise
from roletrust_baselines.treatment import no_accounts, shares
from roletrust_env.arrays import Array, device_of, largest, namespace
from roletrust_env.game.accounts import Accounts
from roletrust_env.game.policy import Channel
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.parameters import (
    Accomplices,
    NotSearched,
    SearchRange,
    Share,
    Weighting,
    checked_dataclass,
)
from roletrust_env.randomness import Random


@checked_dataclass
class Ring(AgreeingRater):
    """Ring whose providers cheat above a threshold of trust, while its raters lift them and sink
    the best others.

    Attributes:
        threshold: Own ToP from which on a provider cheats, in [0, 1].
        bad: Quality of bad service, in [0, 1].
        cut: Rank down to which other providers are sunk, from 0, the best one only, to 1, all of
            them.
        sink: Share by which their ratings are reduced, in [0, 1].
        accomplices: Indices of the ring's providers among all providers. They are always rated 1
            and have no rank. None is a ring without providers.
    """

    threshold: Share = 0.7
    bad: Share = 0.0
    cut: Share = 0.4
    sink: Share = 1.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad quality while active and trusted, and 1 otherwise. See `Policy.quality`."""
        return self.service(view, view.trust >= self.threshold), memory

    def service(self, view: ProviderView, trusted: Array) -> Array:
        """Return bad quality where the ring is active and the provider is trusted, and 1 elsewhere,
        shape (...).
        """
        zero = 0 * view.trust
        return namespace(zero).where(self.active(view.round) & trusted, zero + self.bad, zero + 1)

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return reduced ratings of the best providers, and honest ones of the rest. See
        `AgreeingRater.lies`.
        """
        return namespace(ranks).where(ranks <= self.cut, estimates * (1 - self.sink), estimates)


@checked_dataclass
class CheatingRing(Ring):
    """Cheating ring: a ring whose providers cheat while they are trusted, and whose raters lift
    them.

    The raters sink the best of the other providers and are honest about the rest. This joins the
    slander and the self-promotion of Hoffman, Zage and Nita-Rotaru (2009) with the opportunistic
    service of Chen, Bao and Guo (2016).

    Attributes:
        accomplices: Indices of the ring's providers among all providers. They are always rated 1
            and have no rank.
    """

    accomplices: Annotated[AgentIndices, Accomplices()] = field(kw_only=True)


@checked_dataclass
class DividedRing(CheatingRing):
    """Divided ring: a cheating ring whose raters praise one of its providers each, so that bad
    service of a provider betrays only the raters that praise it.

    By default its providers always serve badly, and its raters are honest about all other
    providers, also about the rest of the ring. Where reports are open, each rater repeats its
    praise in every round, and outnumbers the consumers that were cheated. This variant is not from
    a paper.

    Attributes:
        threshold: Own ToP from which on a provider cheats, in [0, 1].
        sink: Share by which the ratings of the best other providers are reduced, in [0, 1].
    """

    threshold: Share = 0.0
    sink: Share = 0.0

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return a memory without perceptions, with a draw of the provider that each agent
        praises. See `Policy.begin`.
        """
        return super().begin(random, shape), random.uniform(shape)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return praise of one provider of the ring, and honest ratings of its others. See
        `AgreeingRater.ratings`.
        """
        lies, estimates = super().ratings(view, memory[0], random)
        means = estimates.means(view.published)
        left_out = self._left_out(means, memory[1])
        return namespace(means).where(left_out, means, lies), (estimates, memory[1])

    def lies_about(self, view: RaterView, memory: Any) -> Array:
        """Return a mask of the praised provider and of other lies. See
        `AgreeingRater.lies_about`.
        """
        return super().lies_about(view, memory[0]) & ~self._left_out(view.published, memory[1])

    def _left_out(self, rows: Array, draw: Array) -> Array:
        """Return a mask of the ring's providers that a rater does not praise, boolean, shape
        (P, ...).
        """
        ring = index_mask(self.accomplices, rows, "accomplices")
        numbers = [
            self.accomplices.index(j) if j in self.accomplices else -1 for j in range(len(rows))
        ]
        number = namespace(rows).asarray(numbers, device=device_of(rows))
        number, share = number.reshape(ring.shape), draw * len(self.accomplices)
        return ring & ((share < number) | (share >= number + 1))


@checked_dataclass
class MilkingRing(CheatingRing):
    """Milking ring: a cheating ring whose providers cheat while their trust is near the highest
    that they have had.

    A cheating ring has to know how high trust rises under a trust model. This ring finds it out:
    its threshold is a share of the highest trust so far. This variant is not from a paper.

    Attributes:
        patience: Number of rounds in which its providers build up trust, while its raters already
            lie.
        threshold: Share of the highest own ToP so far from which on a provider cheats, in [0, 1].
    """

    patience: Annotated[NonNegativeInt, SearchRange(0, 20)] = 3
    threshold: Share = 0.85
    cut: Share = 0.3

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return a memory without perceptions and trust. See `Policy.begin`."""
        estimates = super().begin(random, shape)
        return estimates, estimates.total[0]

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad quality while active and near its highest trust, and 1 otherwise. See
        `Policy.quality`.
        """
        highest = namespace(view.trust).maximum(memory[1], view.trust)
        trusted = (view.trust >= self.threshold * highest) & (
            view.round >= self.start + self.patience
        )
        return self.service(view, trusted), (memory[0], highest)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return praise of the ring and lies about the best others while active. See
        `AgreeingRater.ratings`.
        """
        ratings, estimates = super().ratings(view, memory[0], random)
        return ratings, (estimates, memory[1])

    def estimates(self, memory: Any) -> Estimates:
        """See `AgreeingRater.estimates`."""
        return super().estimates(memory[0])


@checked_dataclass
class PersonalMilkingRing(MilkingRing):
    """Personal milking ring: a milking ring whose providers cheat exactly those raters that think
    well of them.

    Its providers serve by `personal-milking`, and share their accounts: only that provider cheats a
    rater of which it thinks best, since it goes to no other. The others serve it well, and take
    over when it is disappointed. The raters of the ring praise its providers, sink the best of the
    others and lift the rest. Where access is by trust, more raters come to know the ring, and fewer
    the best. This variant is not from a paper.

    Attributes:
        patience: Number of ratings by a rater before a provider cheats it.
        threshold: Mean rating of a provider by a rater from which on it is cheated, in [0, 1].
        bad: Quality for a cheated rater as a share of the quality for the others, in [0, 1].
        lift: Share of the distance to 1 that is added to the ratings of the rest, in [0, 1].
        prior: Number of further ratings of 0.5 in the mean of each rater, in [0, 1000]. The
            threshold is a share of the mean of a perfect provider with as many ratings by a rater
            as this one has on average.
    """

    patience: Annotated[PositiveInt, SearchRange(1, 10)] = 1
    threshold: Share = 0.6
    cut: Share = 0.4
    lift: Share = 1.0
    prior: Annotated[Weighting, NotSearched()] = 0.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"treatment", "ratings"})

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return a memory without perceptions and accounts. See `Policy.begin`."""
        return Estimates.nothing(random, shape), no_accounts(random, shape)

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return 1: it is up to the treatment. See `Policy.quality`."""
        return 0 * view.trust + 1, memory

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return reduced ratings of the best providers, and raised ones of the rest. See
        `AgreeingRater.lies`.
        """
        reduced, raised = estimates * (1 - self.sink), praise(estimates, self.lift)
        return namespace(ranks).where(ranks <= self.cut, reduced, raised)

    def treats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """Return bad shares for the raters that think well of it while active, and 1 else. See
        `Policy.treats`.
        """
        accounts = memory[1].hear(view.ratings, view.rated)
        means, usual = accounts.with_prior(self.prior).mean, accounts.count.mean(axis=0)
        rival = Accounts(usual, usual, usual).with_prior(self.prior).mean
        trusting = (accounts.count >= self.patience) & (means >= self.threshold * rival)
        cheated = trusting & (means == largest(means, axis=1)[:, None]) & self.active(view.round)
        return shares(view, cheated, self.bad), (memory[0], accounts)
