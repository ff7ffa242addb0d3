"""Scripted attacks by services that differ from rater to rater."""

from typing import Annotated, Any, ClassVar

from pydantic import NonNegativeInt, PositiveInt

from roletrust_baselines.agent_indices import AgentIndices, index_mask
from roletrust_env.arrays import Array, device_of, namespace
from roletrust_env.game.accounts import Accounts
from roletrust_env.game.policy import Channel, WindowedAttack
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import NotSearched, SearchRange, Share, checked_dataclass
from roletrust_env.randomness import Random


class UnequalProvider(WindowedAttack):
    """Provider that cheats some raters and serves the others as well as it can.

    Attributes:
        bad: Quality for the cheated raters as a share of the quality for the others, in [0, 1].
    """

    bad: float
    attacks: ClassVar[frozenset[Channel]] = frozenset({"treatment"})

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether it would cheat each rater in this round, boolean, shape (S, 1 ...) or (S,
        ...), and memory.
        """
        raise NotImplementedError

    def treats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """Return the share of quality for each rater: bad for the cheated ones while active. See
        `Policy.treats`.
        """
        cheated, memory = self.cheats(view, memory, random)
        return shares(view, cheated & self.active(view.round), self.bad), memory


def shares(view: ProviderView, cheated: Array, bad: float) -> Array:
    """Return the share of quality for each rater, shape (S, ...): `bad` for the cheated ones, and 1
    for the others.
    """
    full_shares = 0 * view.ratings + 1
    return namespace(full_shares).where(cheated, bad * full_shares, full_shares)


@checked_dataclass
class Conflicting(UnequalProvider):
    """Conflicting behaviour: a provider that serves chosen raters badly and all others well.

    Sun, Han and Liu (2008), "Defense of Trust Management Vulnerabilities in Distributed Networks":
    the ratings of honest raters contradict each other, so that honest raters look like liars to one
    another. Dellarocas (2000) describes the same behaviour of sellers as discrimination against
    buyers. The number of raters that are served badly is not specified there.

    Attributes:
        raters: Indices of the raters that it serves badly; None is the first half of all raters,
            rounded up.
        bad: Quality for these raters as a share of the quality for the others, in [0, 1].
        threshold: Own ToP from which on it serves them badly, in [0, 1]. A high one wins them
            first.
    """

    raters: AgentIndices | None = None
    bad: Share = 0.0
    threshold: Annotated[Share, NotSearched()] = 0.0

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether each rater is one of the chosen ones, while it is trusted. See
        `UnequalProvider.cheats`.
        """
        half = tuple(range((len(view.ratings) + 1) // 2))
        chosen = index_mask(
            half if self.raters is None else self.raters, view.ratings, "raters", axis="rater"
        )
        return chosen & (view.trust >= self.threshold), memory


@checked_dataclass
class Discrimination(UnequalProvider):
    """Discrimination: a provider that serves a few raters badly, so few that their ratings pass for
    lies or outliers.

    Dellarocas (2000), "Immunizing Online Reputation Reporting Systems against Unfair Ratings and
    Discriminatory Behavior", describes sellers that serve a few buyers differently. The number is
    not specified there. Half of the raters, as under `conflicting`, can outvote the others; a few
    are what a filter of ratings drops.

    Attributes:
        share: Share of the raters that it serves badly, in [0, 1], rounded, at least one: the first
            ones.
        bad: Quality for these raters as a share of the quality for the others, in [0, 1].
    """

    share: Annotated[Share, SearchRange(0.05, 0.5)] = 0.3
    bad: Share = 0.0

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether each rater is one of the first ones. See `UnequalProvider.cheats`."""
        return index_mask(tuple(range(self.few(view))), view.ratings, "share", axis="rater"), memory

    def few(self, view: ProviderView) -> int:
        """Return the number of raters that it serves badly."""
        return max(1, round(self.share * len(view.ratings)))


@checked_dataclass
class QuietDiscrimination(Discrimination):
    """Discrimination against the quiet: a provider that serves those badly whose ratings arrive
    least often.

    Their voices count least with others, where ratings are lost or withheld. Which raters are quiet
    changes from game to game and from round to round; of equally quiet ones the first are cheated.
    This variant is not from a paper.

    Attributes:
        share: Share of the raters that it serves badly, in [0, 1], rounded, at least one.
    """

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return accounts without ratings. See `Policy.begin`."""
        return no_accounts(random, shape)

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether each rater is one of those with the fewest ratings. See
        `UnequalProvider.cheats`.
        """
        xp, accounts = namespace(view.ratings), memory.hear(view.ratings, view.rated)
        order = xp.argsort(accounts.count, axis=0, stable=True)
        return xp.argsort(order, axis=0) < self.few(view), accounts


@checked_dataclass
class Rotation(UnequalProvider):
    """Rotation: a provider that cheats groups of raters in turn, and serves all others well.

    Each rater meets an on-off attack of its own, while most raters praise the provider at any time.
    Su and Saint-Jore (EWSN 2023) describe the on-off attack on all raters at once; this variant is
    not from a paper.

    Attributes:
        groups: Number of groups of raters, which stand side by side. With a single one all are
            cheated.
        turn: Number of rounds for which a group is cheated.
        bad: Quality for the group in turn as a share of the quality for the others, in [0, 1].
    """

    groups: Annotated[PositiveInt, SearchRange(2, 10)] = 3
    turn: Annotated[PositiveInt, SearchRange(1, 12)] = 5
    bad: Share = 0.0

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether each rater is in the group in turn. See `UnequalProvider.cheats`."""
        xp, raters = namespace(view.ratings), len(view.ratings)
        group = xp.asarray(
            [place * self.groups // raters for place in range(raters)],
            device=device_of(view.ratings),
        )
        in_turn = (view.round - self.start) // self.turn % self.groups
        return group.reshape(-1, *[1] * (view.ratings.ndim - 1)) == in_turn, memory


@checked_dataclass
class PersonalMilking(UnequalProvider):
    """Personal milking: a provider that cheats exactly those raters that think well of it.

    It keeps the mean of the ratings that each rater gave it, serves a rater well until this is
    high, and badly as long as it is. So it cheats those that come to it by what they know
    themselves, and keeps the praise of all others. Where ratings are lost, most of its bad services
    are not counted. With a late `start` it is an exit by rater. This is the opportunistic service
    of Chen, Bao and Guo (2016), by the trust of each rater in place of that of all.

    Attributes:
        threshold: Mean rating by a rater from which on it is cheated, in [0, 1].
        patience: Number of ratings by a rater before it is cheated.
        bad: Quality for a cheated rater as a share of the quality for the others, in [0, 1].
    """

    start: Annotated[NonNegativeInt, SearchRange(0, 50)] = 0
    threshold: Share = 0.6
    patience: Annotated[PositiveInt, SearchRange(1, 10)] = 1
    bad: Share = 0.0

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return accounts without ratings. See `Policy.begin`."""
        return no_accounts(random, shape)

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether each rater thinks well of it. See `UnequalProvider.cheats`."""
        accounts = memory.hear(view.ratings, view.rated)
        return (accounts.count >= self.patience) & (accounts.mean >= self.threshold), accounts


def no_accounts(random: Random, shape: tuple[int, ...]) -> Accounts:
    """Return accounts before the first round, for providers and a batch of this shape.

    The number of raters is not known yet. Its axis has the length 1, which also suits the reset of
    single games.
    """
    like = random.like
    return Accounts.begin(
        namespace(like).zeros((1, *shape), dtype=like.dtype, device=device_of(like))
    )
