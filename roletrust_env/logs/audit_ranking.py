"""Attacks on the ranking of a log: hostile ratings, their price, and the ranks after them."""

import json
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import FiniteFloat, PositiveInt, TypeAdapter, ValidationError

from roletrust_env.errors import validation_message
from roletrust_env.evaluation.specs import parse_settings
from roletrust_env.logs.explain import find_agent
from roletrust_env.logs.log import Log, TooSmallError
from roletrust_env.logs.log_rounds import numbers_of
from roletrust_env.logs.replay import ACTIVE, Ending, HostileRatings
from roletrust_env.logs.shrinkage import Shrinkage
from roletrust_env.parameters import Amount, checked_dataclass
from roletrust_env.randomness import generator
from roletrust_env.trust.edges import pair_ends, pair_keys
from roletrust_env.trust.key_index import Floats, Ints

Goal = Literal["sink", "lift", "enter"]
"""Push an agent out of the top, lift a rated agent into it, or lift an unrated agent into it."""

GOALS: tuple[Goal, ...] = ("sink", "lift", "enter")

MOST = 30
"""Greatest number of accounts of an attack."""

LAST = 12
"""Number of the last rounds with ratings, in which attacks are."""

_DAY = 86_400.0  # seconds


@checked_dataclass
class Prices:
    """Prices of an attack, in any currency.

    Attributes:
        account: Price of a new account, aged or not.
        hijacked: Price of the account of an active rater.
        rating: Price of a rating.
        day: Price of a day from the first hostile rating to the end of the log.
    """

    account: Amount = 1.0
    hijacked: Amount = 10.0
    rating: Amount = 0.1
    day: Amount = 0.0

    @classmethod
    def parsed(cls, text: str) -> "Prices":
        """Return prices from a text such as `account=2,rating=0.5`; others have their defaults.

        Raises:
            ValueError: A part has another form, or a price is unknown or out of range.
        """
        given = parse_settings(text.split(","), "prices")
        try:
            return TypeAdapter(cls).validate_python(given)
        except ValidationError as error:
            raise ValueError(f"prices: {validation_message(error)}") from None


class Row(NamedTuple):
    """A hostile rating: its round among the last ones, from 0, the positions of its account and of
    the rated agent, and its value in [0, 1].
    """

    round: int
    account: int
    agent: int
    value: float


@dataclass(frozen=True)
class Plan:
    """What the hostile accounts do; rounds count back from the end of the log.

    Attributes:
        accounts: Number of accounts.
        strikes: Number of rounds in which they rate the target.
        quiet: Number of rounds after the last strike.
        age: Number of rounds before the first strike in which they rate others only.
        cover: Number of other agents that each rates by their trust: those with the most ratings.
        rivals: Number of agents at the edge of the top that each pushes the other way when it
            strikes.
        hijacked: Whether the accounts are those of active raters, not new.
    """

    accounts: int = 1
    strikes: int = 1
    quiet: int = 0
    age: int = 0
    cover: int = 0
    rivals: int = 0
    hijacked: bool = False


class Attempt(NamedTuple):
    """An attack that was played.

    Attributes:
        rows: Its ratings.
        accounts: Number of its accounts.
        price: Price of its accounts, ratings and days.
        rank: Rank of the target after it, 1 for the best.
        margin: How far the target is beyond the edge of the top, in units of trust.
        success: Whether the target is on the other side of the edge.
    """

    rows: tuple[Row, ...]
    accounts: int
    price: float
    rank: int
    margin: float
    success: bool


class Sent(NamedTuple):
    """A hostile rating: its round, 1 for the last of the log, its account, the rated agent, and
    its value.
    """

    round: int
    account: str
    agent: str
    value: float


class Target(NamedTuple):
    """An agent to push: the goal, its position among the ratees, and its rank without an attack."""

    goal: Goal
    place: int
    rank: int


_LINE = TypeAdapter(tuple[str, PositiveInt, FiniteFloat])


class Journal:
    """Outcomes of attacks in a file, from which an interrupted audit continues.

    Attributes:
        path: File.
        known: Rank and margin by attack.
    """

    def __init__(self, path: Path) -> None:
        """Read the outcomes of an earlier audit; damaged lines are ignored."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path, self.known = path, dict[str, tuple[int, float]]()
        for line in path.read_text(errors="replace").splitlines() if path.exists() else ():
            with suppress(ValueError):
                key, rank, beyond = _LINE.validate_json(line, strict=True)
                self.known[key] = rank, beyond

    def add(self, key: str, outcome: tuple[int, float]) -> None:
        """Append an outcome to the file."""
        self.known[key] = outcome
        with self.path.open("a") as file:
            file.write("\n" + json.dumps([key, *outcome]))


class Ranking:
    """The ranks at the end of a log, without and with an attack.

    Rated agents rank by their shrunken trust; of equals, those with the higher trust, then those
    with more ratings, come first.

    Attributes:
        model: Trust model.
        log: Log.
        every: Length of a round in seconds; None for a single round.
        numbers: Number of the round of each rating, shape (n,), ascending.
        shrinkage: How trust is drawn to a mean; no attack changes it.
        top: Number of agents in the top.
        newcomer: Position of an unrated agent; those after it are unrated, too.
        fresh: Position of the first new account; there are 30.
        size: Number of ratees, with the unrated ones.
        order: Positions of the ranked agents without an attack, the best first.
        popular: Positions of the rated agents, those with the most ratings first.
        estimate: Shrunken trust without an attack, shape (size,).
        trust: Trust without an attack, shape (size,).
        raters: Number of raters, shape (size,).
        total: Number of ratings, shape (size,).
    """

    def __init__(
        self,
        model: Any,
        log: Log,
        every: float | None,
        *,
        top: int = 10,
        shrinkage: Shrinkage = Shrinkage(),  # noqa: B008 - immutable
        journal: Journal | None = None,
    ) -> None:
        """Play the log.

        Args:
            model: Trust model.
            log: Log.
            every: Length of a round in seconds; None for a single round.
            top: Number of agents in the top.
            shrinkage: How trust is drawn to a mean.
            journal: Known outcomes of attacks.

        Raises:
            TooSmallError: The log has too few ranked agents.
            ValueError: `every` is given, and the log has no times.
            MemoryError: The model does not fit, see `make_run`.
        """
        self.model, self.log, self.every, self.top = model, log, every, top
        self.shrinkage, self._journal = shrinkage, journal
        self.numbers = numbers_of(log, every)
        facts = *log[:3], self.numbers, np.array([top, log.same_agents, *shrinkage])
        self._digest = sha256(
            b"".join(np.asarray(fact).tobytes() for fact in facts) + repr(model).encode()
        )
        played = np.unique(self.numbers)[-LAST:]
        ago = played[-1] + 1 - played
        self._ago = [int(ago[0])] * (LAST - len(ago)) + ago.tolist()  # rounds to the end of the log
        self._end = Ending(
            model, log, self.numbers, LAST, same_agents=log.same_agents, more=1 + MOST
        )
        self.newcomer, self.fresh = log.shape[1], log.shape[0] + 1
        self.size = self.newcomer + 1 + MOST
        self._keys, counts = np.unique(pair_keys(log.ratees, log.raters), return_counts=True)
        received, given = (np.bincount(side) for side in (log.ratees, log.raters))
        self.popular = np.argsort(-received, kind="stable")[: (received > 0).sum()]
        self._active = np.argsort(-given, kind="stable")[: (given >= ACTIVE).sum()]
        rated = pair_ends(self._keys)[0]
        self.total = np.bincount(rated, counts, self.size).astype(np.float64)
        self.raters = np.bincount(rated, minlength=self.size)
        columns = self._columns(())
        self.estimate, self.trust, _ = columns
        self.order = self._order(columns)
        if len(self.order) <= top:
            raise TooSmallError(f"top must be below {len(self.order)} rated agents, got {top}")

    def _columns(self, rows: Sequence[Row]) -> list[Floats]:
        """Return the keys of the ranks, each shape (size,): estimate, trust, number of ratings."""
        table = np.array(rows, np.float64).reshape(-1, 4)
        number, who, whom = table[:, :3].astype(np.int64).T
        sent = (number == at for at in range(LAST))
        trust = self._end.trust([HostileRatings(who[at], whom[at], table[at, 3]) for at in sent])
        keys, more = np.unique(pair_keys(whom, who), return_counts=True)
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        rated = pair_ends(keys)[0]
        total = self.total + np.bincount(rated, more, self.size)
        raters = self.raters + np.bincount(rated, self._keys[at] != keys, self.size)
        return [self.shrinkage.of(trust, raters), trust, total]

    def targets(self, many: int, seed: int, named: Sequence[str] = ()) -> list[Target]:
        """Return the agents of the top, drawn ones from below it, and a newcomer.

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

    def play(self, target: Target, rows: Sequence[Row], prices: Prices) -> Attempt:
        """Play an attack.

        Args:
            target: Target.
            rows: Ratings of the attack.
            prices: Prices of accounts and ratings.
        """
        rank, beyond = self._outcome(target.place, list(rows))
        down = target.goal == "sink"
        return Attempt(
            tuple(rows),
            accounts=len({row.account for row in rows}),
            price=self.price(rows, prices),
            rank=rank,
            margin=-beyond if down else beyond,
            success=(rank > self.top) == down,
        )

    def _outcome(self, place: int, rows: list[Row]) -> tuple[int, float]:
        """Return the rank of an agent after an attack, and how far it is above the edge of the
        others' top.
        """
        digest = self._digest.copy()
        digest.update(repr((place, rows)).encode())
        key = digest.hexdigest()
        if self._journal and key in self._journal.known:
            return self._journal.known[key]
        columns = self._columns(rows)
        order = self._order(columns)
        rank = 1 + int(np.argmax(np.append(order, place) == place))  # an unrated agent is the last
        edge = columns[0][order[order != place][self.top - 1]]
        outcome = rank, float(columns[0][place] - edge)
        if self._journal:
            self._journal.add(key, outcome)
        return outcome

    @staticmethod
    def _order(columns: Sequence[Floats]) -> Ints:
        """Return the positions of the rated agents by the keys of the ranks, the best first."""
        order: Ints = np.lexsort([-column for column in columns[::-1]])
        return order[columns[-1][order] > 0]

    def days(self, rows: Sequence[Row]) -> float:
        """Return the number of days from the first rating to the end of the log; NaN without
        times.
        """
        rounds = max((self._ago[row.round] for row in rows), default=0)
        return math.nan if self.every is None else rounds * self.every / _DAY

    def price(self, rows: Sequence[Row], prices: Prices) -> float:
        """Return the price of ratings, of their accounts and of their days."""
        accounts = {row.account for row in rows}
        new = sum(account >= self.fresh for account in accounts)
        bought = new * prices.account + (len(accounts) - new) * prices.hijacked
        time = self.days(rows) * prices.day if prices.day else 0.0
        return float(bought + len(rows) * prices.rating + time)

    def sent(self, rows: Sequence[Row]) -> list[Sent]:
        """Return ratings with the names of their agents."""
        fresh = ["newcomer", *(f"new account {number}" for number in range(1, MOST + 1))]
        raters, ratees = [*self.log.rater_names, *fresh], [*self.log.ratee_names, *fresh]
        return [
            Sent(self._ago[number], raters[who], ratees[whom], value)
            for number, who, whom, value in rows
        ]

    def rows(self, target: Target, plan: Plan) -> list[Row]:
        """Return the ratings of a plan; there may be fewer active raters than it hijacks."""
        last = LAST - plan.quiet
        first = max(0, last - plan.strikes)
        begin = max(0, first - plan.age)
        down = target.goal == "sink"
        decoys = self.popular[self.popular != target.place][: plan.cover].tolist()
        rivals, rows = self.rivals(target, plan.rivals), list[Row]()
        for account in self._accounts(target, plan).tolist():
            for number in range(first, last):
                rows.append(Row(number, account, target.place, float(not down)))
                rows += [Row(number, account, rival, float(down)) for rival in rivals]
            for n, other in enumerate(decoys):
                number = min(begin + n % max(1, first - begin), LAST - 1)
                rows.append(Row(number, account, other, float(self.trust[other])))
        return sorted(row for row in rows if row.account != row.agent or not self.log.same_agents)

    def rivals(self, target: Target, many: int) -> list[int]:
        """Return the positions of so many agents at the edge of the top, on the side to which a
        target is pushed.
        """
        down = target.goal == "sink"
        edge = (
            self.order[self.top : self.top + many]
            if down
            else self.order[max(0, self.top - many) : self.top]
        )
        return [at for at in edge.tolist() if at != target.place]

    def _accounts(self, target: Target, plan: Plan) -> Ints:
        """Return the positions of the accounts of a plan: of hijacked ones, raters of the target
        first, then those with the most ratings.
        """
        if not plan.hijacked:
            return self.fresh + np.arange(plan.accounts)
        own = self.log.raters[self.log.ratees == target.place]
        active = self._active[np.argsort(~np.isin(self._active, own), kind="stable")]
        if self.log.same_agents:
            active = active[active != target.place]
        return active[: plan.accounts]
