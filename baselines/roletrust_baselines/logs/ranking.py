"""Attacks on the ranking of a log: what hostile accounts send, what it costs, and the ranks after it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from roletrust_baselines.logs.replay import ROUNDS, Ending, HostileRatings
from roletrust_baselines.logs.rounds import TooSmallError
from roletrust_env.data.evidence import Rank, wilson_interval
from roletrust_env.data.log import RatingLog
from roletrust_env.trust.edges import pair_ends, pair_keys
from roletrust_env.trust.key_index import Floats, Ints

Goal = Literal["sink", "lift", "enter"]
"""Push an agent out of the top, push a ranked agent into it, or push one into it that nobody has rated."""

Origin = Literal["new", "aged", "hijacked"]
"""Accounts that join for the attack; that have rated as others do for some rounds; that are those of active raters."""

GOALS: tuple[Goal, ...] = ("sink", "lift", "enter")
ORIGINS: tuple[Origin, ...] = ("new", "aged", "hijacked")
ACCOUNTS = (1, 3, 10, 30)
"""Numbers of accounts that are compared; the last is the greatest that a search tries."""

MOST = ACCOUNTS[-1]
"""Greatest number of accounts of an attack."""

_DAY = 86_400.0  # seconds


class Prices(NamedTuple):
    """What an attack costs, in any currency.

    Attributes:
        account: Price of a new account, also of one that ages.
        hijacked: Price of the account of an active rater.
        rating: Price of a rating.
    """

    account: float = 1.0
    hijacked: float = 10.0
    rating: float = 0.1

    def of_account(self, origin: Origin) -> float:
        """Return the price of an account of an origin."""
        return self.hijacked if origin == "hijacked" else self.account


@dataclass(frozen=True)
class Plan:
    """What the hostile accounts do; rounds count back from the end of the log.

    Attributes:
        origin: Origin of the accounts.
        accounts: Number of accounts, at least 1.
        strikes: Number of rounds in which they rate the target, at least 1.
        turns: Whether each strikes in one of these rounds only, in turn.
        quiet: Number of rounds after the last strike.
        age: Number of rounds before the first strike in which they rate others only.
        mildness: Distance of their rating of the target from the worst or best, at most 0.5.
        cover: Number of others that each rates in each of its rounds as the log rates them on average.
        popular: Whether these others are those with the most ratings. Otherwise they are drawn.
        rivals: Number of agents at the edge of the top that each pushes the other way when it strikes.
        ring: Number of other accounts to which each gives the best rating in the first round.
        choice: Which active raters are hijacked: 0 those with the most ratings, 1 the fewest, 2 those of the target.
    """

    origin: Origin = "new"
    accounts: int = 1
    strikes: int = 1
    turns: bool = False
    quiet: int = 0
    age: int = 0
    mildness: float = 0.0
    cover: int = 0
    popular: bool = True
    rivals: int = 0
    ring: int = 0
    choice: int = 0

    @property
    def words(self) -> str:
        """The plan in a few words, without the number of accounts."""
        parts = [
            (True, f"{self.origin}" + (("", ", least active", ", its raters")[self.choice])),
            (self.age, f"{self.age} rounds of age"),
            (self.strikes > 1, f"{self.strikes} rounds" + " in turn" * self.turns),
            (self.quiet, f"{self.quiet} quiet after"),
            (self.mildness, f"{self.mildness:g} mild"),
            (self.cover, f"{self.cover} decoys" + (", drawn" * (not self.popular))),
            (self.rivals, f"{self.rivals} rivals"),
            (self.ring, f"ring of {self.ring}"),
        ]
        return "; ".join(words for there, words in parts if there)


@dataclass(frozen=True)
class Attempt:
    """An attack that was played.

    Attributes:
        plan: What its accounts do.
        spared: Number of ratings of the plan that were left out.
        accounts: Number of accounts that rate.
        ratings: Number of ratings.
        rounds: Number of rounds from its first rating to the end of the log.
        days: The same in days, if times are in seconds.
        price: Price of its accounts and ratings.
        rank: Rank of the target after it, 1 for the most trusted.
    """

    plan: Plan
    spared: int
    accounts: int
    ratings: int
    rounds: int
    days: float
    price: float
    rank: int


class Sent(NamedTuple):
    """A hostile rating: its round, 1 for the last of the log, its account, whom it is about, and its value."""

    round: int
    account: str
    agent: str
    value: float


class Target(NamedTuple):
    """An agent that is pushed: where, its place among the providers, and its rank without an attack."""

    goal: Goal
    place: int
    rank: int


class Ranking:
    """The ranks at the end of a log, without and with an attack.

    Agents with ratings rank as in `roletrust_env.data.evidence`: by the lower end of the interval of their trust, or by
    trust; of equals, those with the higher trust, and with more ratings, come first.

    Attributes:
        top: Number of agents in the top.
        newcomer: Place of an agent that nobody has rated.
        order: Places of the ranked agents without an attack, the best first.
    """

    def __init__(
        self, model: Any, log: RatingLog, every: float, *, same_agents: bool, top: int = 10, rank_by: Rank = "low"
    ) -> None:
        """Play the log.

        Args:
            model: Trust model.
            log: Log with times.
            every: Length of a round.
            same_agents: Whether a rater and a ratee of one name are one agent.
            top: Number of agents in the top.
            rank_by: What agents are ranked by.

        Raises:
            TooSmallError: The log has too few rounds, or too few ranked agents.
            MemoryError: The model does not fit, see `make_run`.
        """
        self.top, self._rank_by, self._every = top, rank_by, every
        self._end = Ending(model, log, every, same_agents=same_agents, more=1 + MOST)
        self.newcomer = log.shape[1]
        self._fresh = log.shape[0] + 1 + np.arange(MOST)
        self._keys, self._counts = np.unique(pair_keys(log.ratees, log.raters), return_counts=True)
        received = np.argsort(-np.bincount(log.ratees[: self._end.past]), kind="stable")
        self._popular = received[~np.isnan(self._end.past_means[received])]
        self._size = log.shape[1] + 1 + MOST
        rated = pair_ends(self._keys)[0]
        self._total = np.bincount(rated, self._counts, self._size).astype(np.float64)
        self._squares = np.bincount(rated, self._counts.astype(np.float64) ** 2, self._size)
        columns = self._columns([_ratings()] * ROUNDS)
        order = np.lexsort([-column for column in columns[::-1]])
        self.order: Ints = order[self._total[order] > 0]
        if len(self.order) <= top:
            raise TooSmallError(f"{len(self.order)} agents have ratings; more than the top {top} are needed")

    def _columns(self, rounds: Sequence[HostileRatings]) -> list[Floats]:
        """Return what providers rank by, each from low to high: lower end or trust, trust, number of ratings."""
        trust = self._end.trust(rounds)
        who, whom = (np.concatenate(column) for column in list(zip(*rounds, strict=True))[:2])
        keys, more = np.unique(pair_keys(whom, who), return_counts=True)
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        had = np.where(self._keys[at] == keys, self._counts[at], 0)
        total, squares, rated = self._total.copy(), self._squares.copy(), pair_ends(keys)[0]
        np.add.at(total, rated, more)
        np.add.at(squares, rated, more * (more + 2 * had))
        low, _ = wilson_interval(trust, total**2 / np.maximum(squares, 1.0))  # see `effective_number`
        return [low if self._rank_by == "low" else trust, trust, total]

    def targets(self, many: int, seed: int) -> list[Target]:
        """Return the agents of the top, so many that are drawn from those below it, and a newcomer."""
        drawn = np.sort(np.random.default_rng(seed).permutation(len(self.order) - self.top)[:many]) + self.top
        ranks = [*(("sink", at) for at in range(self.top)), *(("lift", int(at)) for at in drawn)]
        found = [Target(goal, int(self.order[at]), at + 1) for goal, at in ranks]  # type: ignore[arg-type]
        return [*found, Target("enter", self.newcomer, len(self.order) + 1)]

    def play(
        self, target: Target, plan: Plan, prices: Prices, rounds: Sequence[HostileRatings] | None = None
    ) -> Attempt:
        """Play an attack.

        Args:
            target: Target.
            plan: What the accounts do; there may be fewer active raters than it hijacks.
            prices: What accounts and ratings cost.
            rounds: The ratings of the plan that are sent; all if left out.
        """
        whole = self.ratings(target, plan)
        rounds = whole if rounds is None else rounds
        many, all_of_them = (sum(len(extra.raters) for extra in sent) for sent in (rounds, whole))
        rank = self._rank(target.place, self._columns(rounds))
        length = ROUNDS - next((number for number, extra in enumerate(rounds) if len(extra.raters)), ROUNDS)
        accounts, price = self.price(plan, prices, rounds)
        return Attempt(plan, all_of_them - many, accounts, many, length, length * self._every / _DAY, price, rank)

    def _rank(self, place: int, columns: Sequence[Floats]) -> int:
        """Return the rank of a provider; one without ratings comes after all that have some."""
        ranked = columns[-1] > 0
        if not ranked[place]:
            return int(ranked.sum()) + 1
        before, equal = np.zeros(self._size, bool), ranked
        for column in columns:
            before |= equal & (column > column[place])
            equal = equal & (column == column[place])
        return 1 + int(before.sum() + equal[:place].sum())

    def price(self, plan: Plan, prices: Prices, rounds: Sequence[HostileRatings]) -> tuple[int, float]:
        """Return the number of accounts that send ratings, and the price of all."""
        accounts = len(np.unique(np.concatenate([extra.raters for extra in rounds])))
        many = sum(len(extra.raters) for extra in rounds)
        return accounts, accounts * prices.of_account(plan.origin) + many * prices.rating

    def sent(self, rounds: Sequence[HostileRatings]) -> list[Sent]:
        """Return ratings with the names of their agents."""
        (raters, providers), fresh = (self._end.log.rater_names, self._end.log.ratee_names), self._fresh[0]
        return [
            Sent(
                ROUNDS - number,
                raters[who] if who < len(raters) else f"new account {who - fresh + 1}",
                _provider(providers, whom, int(fresh)),
                value,
            )
            for number, extra in enumerate(rounds)
            for who, whom, value in zip(*(column.tolist() for column in extra), strict=True)
        ]

    def named(self, target: Target) -> tuple[str, int, int]:
        """Return the name, the rank and the number of ratings of a target."""
        names = self._end.log.ratee_names
        name = names[target.place] if target.place < len(names) else ""
        return name, target.rank, int(self._total[target.place])

    def over_edge(self, target: Target, rank: int) -> bool:
        """Return whether a target is on the other side of the edge of the top at a rank."""
        return (rank > self.top) if target.goal == "sink" else (rank <= self.top)

    def ratings(self, target: Target, plan: Plan) -> list[HostileRatings]:
        """Return the ratings of a plan in each of the last rounds."""
        accounts = self._accounts(target, plan).tolist()
        last = ROUNDS - plan.quiet
        first = last - plan.strikes
        begin = max(0, first - plan.age)
        worst, best = plan.mildness, 1 - plan.mildness
        down = target.goal == "sink"
        rng, means = np.random.default_rng(0), self._end.past_means
        known = self._popular[self._popular != target.place]
        edge = [
            at
            for at in self.order[max(0, self.top - plan.rivals) : self.top + plan.rivals].tolist()
            if at != target.place
        ]
        rivals = [at for at in edge if (at in self.order[: self.top]) != down]
        rounds = []
        for number in range(ROUNDS):
            sent = list[tuple[int, int, float]]()
            for k, account in enumerate(accounts if begin <= number < last else ()):
                if number >= first and (not plan.turns or number == first + k % plan.strikes):
                    sent.append((account, target.place, worst if down else best))
                    sent += [(account, rival, float(down)) for rival in rivals]
                if plan.ring and number == begin and self._end.same_agents:
                    sent += [(account, other, 1.0) for other in (accounts[k + 1 :] + accounts[:k])[: plan.ring]]
                if plan.cover:
                    some = (
                        known[: plan.cover] if plan.popular else rng.choice(known, min(plan.cover, len(known)), False)
                    )
                    sent += [(account, other, means[other]) for other in some.tolist()]
            rounds.append(_ratings([one for one in sent if one[0] != one[1] or not self._end.same_agents]))
        return rounds

    def _accounts(self, target: Target, plan: Plan) -> Ints:
        """Return the places of the accounts."""
        if plan.origin != "hijacked":
            return self._fresh[: plan.accounts]
        active = self._end.ranked[::-1] if plan.choice != 1 else self._end.ranked
        if plan.choice == 2:
            log = self._end.log
            active = active[np.argsort(~np.isin(active, log.raters[log.ratees == target.place]), kind="stable")]
        if self._end.same_agents:
            active = active[active != target.place]
        return active[: plan.accounts]


def _ratings(sent: Sequence[tuple[int, int, float]] = ()) -> HostileRatings:
    """Return ratings, each with its account, provider and value, as columns."""
    who, whom, values = zip(*sent, strict=True) if sent else ((), (), ())
    return HostileRatings(np.array(who, np.int64), np.array(whom, np.int64), np.array(values, np.float64))


def _provider(names: Sequence[str], place: int, fresh: int) -> str:
    """Return the name of an agent that is rated, which may be new."""
    if place < len(names):
        return names[place]
    return "newcomer" if place == len(names) else f"new account {place - fresh + 1}"
