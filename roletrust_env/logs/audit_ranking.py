"""Attacks on the ranking of a log: what hostile accounts send, what it costs, and the ranks after
it.
"""

import json
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import FiniteFloat, PositiveInt, TypeAdapter

from roletrust_env.logs.evidence import Rank, wilson_interval
from roletrust_env.logs.explain import find_agent
from roletrust_env.logs.log import Log, TooSmallError
from roletrust_env.logs.log_rounds import numbers_of
from roletrust_env.logs.replay import ACTIVE, Ending, HostileRatings
from roletrust_env.parameters import truth_value
from roletrust_env.randomness import generator
from roletrust_env.trust.edges import pair_ends, pair_keys
from roletrust_env.trust.key_index import Floats, Ints

Goal = Literal["sink", "lift", "enter"]
"""Push an agent out of the top, push a ranked agent into it, or push one into it that nobody has
rated."""

Origin = Literal["new", "aged", "hijacked"]
"""Accounts that join for the attack; that have rated as others do for some rounds; that are those
of active raters."""

GOALS: tuple[Goal, ...] = ("sink", "lift", "enter")
ORIGINS: tuple[Origin, ...] = ("new", "aged", "hijacked")
ACCOUNTS = (1, 3, 10, 30)
"""Numbers of accounts that are compared; the last is the greatest that a search tries."""

MOST = ACCOUNTS[-1]
"""Greatest number of accounts of an attack."""

LAST = 12
"""Number of the last rounds of a log, in which attacks are. Where the age of an account counts,
fewer are dearer."""

_DAY = 86_400.0  # seconds


class Prices(NamedTuple):
    """What an attack costs, in any currency.

    Attributes:
        account: Price of a new account, also of one that ages.
        hijacked: Price of the account of an active rater.
        rating: Price of a rating.
        day: Price of a day from the first rating to the end of the log.
    """

    account: float = 1.0
    hijacked: float = 10.0
    rating: float = 0.1
    day: float = 0.0


class Row(NamedTuple):
    """A hostile rating: the number of its round among the last ones, from 0, and as places account
    and agent.
    """

    round: int
    account: int
    agent: int
    value: float


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
        cover: Number of others that each rates by their trust, in turn in the rounds of age, or in
            the first strike.
        popular: Whether these others are those with the most ratings. Otherwise they are drawn.
        rivals: Number of agents at the edge of the top that each pushes the other way when it
            strikes.
        ring: Number of other accounts to which each gives the best rating in the first round.
        choice: Which active raters are hijacked: 0 those with the most ratings, 1 the fewest, 2
            those of the target.
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
        changed: Whether ratings of the plan were left out or changed.
        accounts: Number of accounts that rate.
        ratings: Number of ratings.
        rounds: Number of rounds from its first rating to the end of the log.
        days: The same in days, if times are in seconds; NaN without times.
        price: Price of its accounts and ratings.
        rank: Rank of the target after it, 1 for the most trusted.
        margin: How far what the target is ranked by is beyond that of the edge, which makes equal
            attacks comparable.
    """

    plan: Plan
    changed: bool
    accounts: int
    ratings: int
    rounds: int
    days: float
    price: float
    rank: int
    margin: float


class Sent(NamedTuple):
    """A hostile rating: its round, 1 for the last of the log, its account, whom it is about, and
    its value.
    """

    round: int
    account: str
    agent: str
    value: float


class Target(NamedTuple):
    """An agent that is pushed: where, its place among the providers, and its rank without an
    attack.
    """

    goal: Goal
    place: int
    rank: int


_LINE = TypeAdapter(tuple[str, PositiveInt, FiniteFloat])


class Journal:
    """Outcomes of attacks, kept in a file, so that a search that is interrupted goes on where it
    was.

    Attributes:
        path: File.
        known: Rank and margin by attack.
    """

    def __init__(self, path: Path) -> None:
        """Read what an earlier search has kept; a line that is torn or damaged is ignored."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path, self.known = path, dict[str, tuple[int, float]]()
        for line in path.read_text(errors="replace").splitlines() if path.exists() else ():
            with suppress(ValueError):
                key, rank, beyond = _LINE.validate_json(line, strict=True)
                self.known[key] = rank, beyond

    def add(self, key: str, outcome: tuple[int, float]) -> None:
        """Keep an outcome."""
        self.known[key] = outcome
        with self.path.open("a") as file:
            file.write("\n" + json.dumps([key, *outcome]))


class Ranking:
    """The ranks at the end of a log, without and with an attack.

    Agents with ratings rank as in `roletrust_env.logs.evidence`: by the lower end of the interval
    of their trust, or by trust; of equals, those with the higher trust, and with more ratings, come
    first.

    Attributes:
        model: Trust model.
        log: Log.
        every: Length of a round; None if rounds are by number.
        same_agents: Whether a rater and a ratee of one name are one agent.
        top: Number of agents in the top.
        newcomer: Place of an agent that nobody has rated.
        order: Places of the ranked agents without an attack, the best first.
        popular: Places of the agents with ratings, those with the most first.
        trust: Trust in each agent without an attack.
    """

    def __init__(
        self,
        model: Any,
        log: Log,
        every: float | None,
        *,
        same_agents: bool,
        top: int = 10,
        rank_by: Rank = "low",
        journal: Journal | None = None,
    ) -> None:
        """Play the log.

        Args:
            model: Trust model.
            log: Log.
            every: Length of a round in seconds; None for a single round.
            same_agents: Whether a rater and a ratee of one name are one agent.
            top: Number of agents in the top.
            rank_by: What agents are ranked by.
            journal: Outcomes that are known.

        Raises:
            TooSmallError: The log has too few ranked agents.
            ValueError: Rounds go by time, and the log has no times.
            MemoryError: The model does not fit, see `make_run`.
        """
        self.top, self.every, self._rank_by, self._journal = top, every, rank_by, journal
        self.model, self.log, self.same_agents = model, log, truth_value("same_agents", same_agents)
        numbers = numbers_of(log, every)
        facts = *log[:3], numbers, np.array([top, self.same_agents, rank_by == "low"])
        self._digest = sha256(
            b"".join(np.asarray(one).tobytes() for one in facts) + repr(model).encode()
        )
        self._end = Ending(model, log, numbers, LAST, same_agents=self.same_agents, more=1 + MOST)
        self.newcomer = log.shape[1]
        self._fresh = log.shape[0] + 1 + np.arange(MOST)
        self._keys, counts = np.unique(pair_keys(log.ratees, log.raters), return_counts=True)
        received, given = (np.bincount(side) for side in (log.ratees, log.raters))
        self.popular = np.argsort(-received, kind="stable")[: (received > 0).sum()]
        self._active = np.argsort(-given, kind="stable")[: (given >= ACTIVE).sum()]
        self._size = log.shape[1] + 1 + MOST
        rated = pair_ends(self._keys)[0]
        self._total = np.bincount(rated, counts, self._size).astype(np.float64)
        self._raters = np.bincount(rated, minlength=self._size)
        columns = self._columns(())
        order, self.trust = np.lexsort([-column for column in columns[::-1]]), columns[1]
        self.order: Ints = order[self._total[order] > 0]
        if len(self.order) <= top:
            raise TooSmallError(
                f"only {len(self.order)} agents have ratings; the top (--top) must be fewer, and "
                f"is {top}"
            )

    def of(self, model: Any) -> "Ranking":
        """Return the ranking of the same log by another model."""
        settings: Any = {"same_agents": self.same_agents, "top": self.top, "rank_by": self._rank_by}
        return Ranking(model, self.log, self.every, **settings)

    def _columns(self, rows: Sequence[Row]) -> list[Floats]:
        """Return what providers rank by, each from low to high: lower end or trust, trust, number
        of ratings.
        """
        number, who, whom, values = _apart(rows)
        sent = [number == at for at in range(LAST)]
        trust = self._end.trust(
            [HostileRatings(who[there], whom[there], values[there]) for there in sent]
        )
        keys, more = np.unique(pair_keys(whom, who), return_counts=True)
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        total, raters, rated = self._total.copy(), self._raters.copy(), pair_ends(keys)[0]
        np.add.at(total, rated, more)
        np.add.at(raters, rated, self._keys[at] != keys)
        low, _ = wilson_interval(trust, raters)
        return [low if self._rank_by == "low" else trust, trust, total]

    def targets(self, many: int, seed: int, named: Sequence[str] = ()) -> list[Target]:
        """Return the agents of the top, so many that are drawn from those below it, and a newcomer.

        Args:
            many: Number of agents to draw.
            seed: Random seed of the draws.
            named: Names of the agents to return in place of all these.

        Raises:
            ValueError: An agent has no ratings.
        """
        drawn = np.sort(generator(seed).permutation(len(self.order) - self.top)[:many]) + self.top
        chosen = [*range(self.top), *drawn.tolist()]
        if named:
            places = dict.fromkeys(
                find_agent(self.log, name, ("ratee",))["ratee"] for name in named
            )
            chosen = sorted(int(np.flatnonzero(self.order == place)[0]) for place in places)
        found = [
            Target("sink" if at < self.top else "lift", int(self.order[at]), at + 1)
            for at in chosen
        ]
        return found if named else [*found, Target("enter", self.newcomer, len(self.order) + 1)]

    def play(
        self, target: Target, plan: Plan, prices: Prices, rows: Sequence[Row] | None = None
    ) -> Attempt:
        """Play an attack.

        Args:
            target: Target.
            plan: What the accounts do; there may be fewer active raters than it hijacks.
            prices: What accounts and ratings cost.
            rows: Ratings that are sent in place of those of the plan.
        """
        changed, rows = rows is not None, self.rows(target, plan) if rows is None else rows
        rank, beyond = self._outcome(target.place, rows)
        length = self._length(rows)
        return Attempt(
            plan,
            changed,
            accounts=len({row.account for row in rows}),
            ratings=len(rows),
            rounds=length,
            days=self._days(length),
            price=self.price(rows, prices),
            rank=rank,
            margin=-beyond if target.goal == "sink" else beyond,
        )

    def _outcome(self, place: int, rows: Sequence[Row]) -> tuple[int, float]:
        """Return the rank of a provider after an attack, and how far it is above the edge of the
        others' top.
        """
        digest = self._digest.copy()
        digest.update(repr((place, rows)).encode())
        key = digest.hexdigest()
        if self._journal and key in self._journal.known:
            return self._journal.known[key]
        columns = self._columns(rows)
        others = columns[-1] > 0
        others[place] = False
        edge = np.partition(columns[0][others], -self.top)[-self.top]
        outcome = self._rank(place, columns), float(columns[0][place] - edge)
        if self._journal:
            self._journal.add(key, outcome)
        return outcome

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

    def _length(self, rows: Sequence[Row]) -> int:
        """Return the number of rounds from the first rating to the end of the log."""
        return LAST - min((row.round for row in rows), default=LAST)

    def _days(self, rounds: int) -> float:
        return math.nan if self.every is None else rounds * self.every / _DAY

    def price(self, rows: Sequence[Row], prices: Prices) -> float:
        """Return the price of ratings and of their accounts."""
        accounts = {row.account for row in rows}
        new = sum(account >= self._fresh[0] for account in accounts)
        bought = (
            new * prices.account
            + (len(accounts) - new) * prices.hijacked
            + len(rows) * prices.rating
        )
        return float(bought) + (self._days(self._length(rows)) * prices.day if prices.day else 0.0)

    def sent(self, rows: Sequence[Row]) -> list[Sent]:
        """Return ratings with the names of their agents."""
        (raters, providers), fresh = (
            (self.log.rater_names, self.log.ratee_names),
            int(self._fresh[0]),
        )
        return [
            Sent(
                LAST - number,
                raters[who] if who < len(raters) else f"new account {who - fresh + 1}",
                _provider(providers, whom, fresh),
                value,
            )
            for number, who, whom, value in rows
        ]

    def named(self, target: Target) -> tuple[str, int, int]:
        """Return the name, the rank and the number of ratings of a target."""
        names = self.log.ratee_names
        name = names[target.place] if target.place < len(names) else ""
        return name, target.rank, int(self._total[target.place])

    def over_edge(self, target: Target, rank: int) -> bool:
        """Return whether a target is on the other side of the edge of the top at a rank."""
        return (rank > self.top) if target.goal == "sink" else (rank <= self.top)

    def rows(self, target: Target, plan: Plan) -> list[Row]:
        """Return the ratings of a plan."""
        accounts = self._accounts(target, plan).tolist()
        last = LAST - plan.quiet
        first = last - plan.strikes
        begin = max(0, first - plan.age)
        down = target.goal == "sink"
        value = plan.mildness if down else 1 - plan.mildness
        rng = np.random.default_rng(0)
        known = self.popular[self.popular != target.place]
        rivals, rows = self.rivals(target, plan.rivals), list[Row]()
        for k, account in enumerate(accounts):
            strikes = [first + k % plan.strikes] if plan.turns else range(first, last)
            for number in strikes:
                rows.append(Row(number, account, target.place, value))
                rows += [Row(number, account, rival, float(down)) for rival in rivals]
            if self.same_agents:
                others = (accounts[k + 1 :] + accounts[:k])[: plan.ring]
                rows += [Row(begin, account, other, 1.0) for other in others]
            some = (
                known[: plan.cover]
                if plan.popular
                else rng.choice(known, min(plan.cover, len(known)), False)
            )
            rounds = max(1, first - begin)
            for n, other in enumerate(some.tolist()):
                rows.append(Row(begin + n % rounds, account, other, float(self.trust[other])))
        return sorted(row for row in rows if row.account != row.agent or not self.same_agents)

    def rivals(self, target: Target, many: int) -> list[int]:
        """Return the places of agents at the edge of the top, so many on the side to which a target
        is pushed.
        """
        down = target.goal == "sink"
        edge = (
            self.order[self.top : self.top + many]
            if down
            else self.order[max(0, self.top - many) : self.top]
        )
        return [at for at in edge.tolist() if at != target.place]

    def _accounts(self, target: Target, plan: Plan) -> Ints:
        """Return the places of the accounts."""
        if plan.origin != "hijacked":
            return self._fresh[: plan.accounts]
        active = self._active[::-1] if plan.choice == 1 else self._active
        if plan.choice == 2:
            own = self.log.raters[self.log.ratees == target.place]
            active = active[np.argsort(~np.isin(active, own), kind="stable")]
        if self.same_agents:
            active = active[active != target.place]
        return active[: plan.accounts]


def _apart(rows: Sequence[Row]) -> tuple[Ints, Ints, Ints, Floats]:
    """Return ratings as columns."""
    number, who, whom, values = zip(*rows, strict=True) if rows else ((), (), (), ())
    return *(np.array(column, np.int64) for column in (number, who, whom)), np.array(
        values, np.float64
    )  # type: ignore[return-value]


def _provider(names: Sequence[str], place: int, fresh: int) -> str:
    """Return the name of an agent that is rated, which may be new."""
    if place < len(names):
        return names[place]
    return "newcomer" if place == len(names) else f"new account {place - fresh + 1}"
