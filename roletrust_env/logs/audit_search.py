"""The search for the cheapest attack on a log's ranking.

It plays known attacks and plans, and changes the ratings of the cheapest ones. It knows the log and
sees the ranks after each attack. The sequence of attacks does not depend on the budget, which only
ends it.
"""

import math
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from roletrust_env.logs.audit_exact import TIE
from roletrust_env.logs.audit_ranking import (
    LAST,
    MOST,
    Attempt,
    Plan,
    Prices,
    Ranking,
    Row,
    Target,
)

BLOCK = 30
"""Number of attacks after which a search turns from plans to changed ratings, or back; after two
blocks, searches share their best plans."""

_IDLE = 200  # plans in a row, without a new attack among them, that end a search
_STEPS = 0.6  # share of steps from the best among the plans that are drawn
_SPENT = 0.5  # share of the drawn plans that cost nearly as much as the best
_MANY = 20  # most decoys of these
_SHIFTS = (-0.3, -0.1, -0.03, 0.03, 0.1, 0.3)  # of a rating
_DECOYS = 8  # agents that a rating may be turned to, of either kind

SIMPLE = (
    Plan(),
    Plan(strikes=3),
    Plan(cover=3),
    Plan(rivals=2),
    Plan(age=1, cover=2),
    Plan(age=2, cover=6, strikes=2),
    Plan(age=10, cover=10),
    Plan(hijacked=True),
    Plan(hijacked=True, strikes=3),
)
"""Plans that every search tries first."""

_CHOICES: dict[str, tuple[int, ...]] = {
    "strikes": (1, 2, 3, 4, 5, 6, 9),
    "quiet": (0, 0, 1, 3),
    "age": (0, 0, 0, 0, 1, 2, 4, 8),
    "cover": (0, 0, 1, 2, 3, 4, 6, 10),
    "rivals": (0, 0, 1, 2, 5),
    "hijacked": (0, 0, 1),
}


class Search:
    """A search for the cheapest attack on one target.

    Attributes:
        target: Target.
        played: Attacks that were played, by their ratings, the first one first.
        best: The cheapest successful attack; None if there is none.
        plan: The cheapest successful plan; None if there is none.
        shapes: Plans to try next, the last one first.
        lower: Lower bound of the price; NaN if none is known.
        least: Price of a single rating, which no attack is below.
    """

    def __init__(self, ranking: Ranking, target: Target, prices: Prices, seed: int) -> None:
        """Prepare the search.

        Args:
            ranking: Log with its ranks.
            target: Target.
            prices: Prices of accounts and ratings.
            seed: Random seed.
        """
        self.target, self.played = target, dict[tuple[Row, ...], Attempt]()
        self.best: Attempt | None = None
        self.lower = math.nan
        one = (Row(LAST - 1, account, 0, 0.0) for account in (0, ranking.fresh))
        self.least = min(ranking.price([row], prices) for row in one)
        self.plan: Plan | None = None
        self.shapes = list(SIMPLE[::-1])
        self._ranking, self._prices = ranking, prices
        self._plan_price, self._near = math.inf, list[Plan]()
        self._rng = np.random.default_rng((seed, target.place))

    @property
    def price(self) -> float:
        """The lowest price so far."""
        return self.best.price if self.best else math.inf

    def begin(self, rows: Sequence[Row]) -> bool:
        """Play a known attack, and return whether it succeeds; without ratings it does not."""
        if rows:
            list(self._play(rows))
        return self.best is not None

    def steps(self) -> Iterator[None]:
        """Play one attack after another, until there is no new one, or no cheaper one."""
        plans, before = self._plans(), -1
        changes = self._changed(plans)
        while len(self.played) > before and self.price > self.least + TIE:
            before = len(self.played)
            for stream in (plans, changes):
                yield from islice(stream, BLOCK)

    def _play(self, rows: Sequence[Row]) -> Generator[None, None, Attempt]:
        """Return an attack; yield once if it is new."""
        key = tuple(rows)
        if key not in self.played:
            self.played[key] = found = self._ranking.play(self.target, key, self._prices)
            if found.success and (self.best is None or _worth(found) < _worth(self.best)):
                self.best = found
            yield
        return self.played[key]

    def _plans(self) -> Iterator[None]:
        """Play the waiting plans, those near the best one, and drawn ones."""
        idle = 0
        while idle < _IDLE:
            before, price = len(self.played), self._plan_price
            waiting = self.shapes or self._near
            yield from self._reduced(waiting.pop() if waiting else self._drawn())
            if self.plan and self._plan_price < price:
                self._near = _near(self.plan)
            idle = 0 if len(self.played) > before else idle + 1

    def _reduced(self, shape: Plan) -> Iterator[None]:
        """Play a plan with the most accounts that cost no more than the best; if it succeeds, with
        fewer.
        """
        low, high = 0, self._affordable(shape)
        if not high or not (yield from self._succeeds(replace(shape, accounts=high))):
            return
        while high - low > 1:
            middle = (low + high) // 2
            if (yield from self._succeeds(replace(shape, accounts=middle))):
                high = middle
            else:
                low = middle

    def _succeeds(self, plan: Plan) -> Generator[None, None, bool]:
        rows = self._ranking.rows(self.target, plan)
        if not rows:
            return False
        found = yield from self._play(rows)
        if found.success and found.price < self._plan_price - TIE:
            self.plan, self._plan_price = plan, found.price
        return found.success

    def _affordable(self, shape: Plan) -> int:
        """Return the greatest number of accounts with no higher price than that of the best."""
        price = self._price(replace(shape, accounts=1))
        return MOST if price * MOST <= self.price else math.floor(self.price / price + TIE)

    def _price(self, plan: Plan) -> float:
        return self._ranking.price(self._ranking.rows(self.target, plan), self._prices)

    def _drawn(self) -> Plan:
        """Return a step from the best plan in one or two of its numbers, or a plan of which all are
        drawn.
        """
        names, base = list(_CHOICES), Plan()
        if self.plan and self._rng.random() < _STEPS:
            base = self.plan
            names = self._rng.permutation(names)[: self._rng.integers(1, 3)].tolist()
        drawn: dict[str, Any] = {name: int(self._rng.choice(_CHOICES[name])) for name in names}
        plan = replace(base, **drawn)
        return self._spent(plan) if self.best and self._rng.random() < _SPENT else plan

    def _spent(self, plan: Plan) -> Plan:
        """Return a plan with as many decoys as a drawn number of accounts can pay for below the
        best price.
        """
        number = int(self._rng.integers(1, self.best.accounts + 1)) if self.best else 1
        left = self.price / number - self._price(replace(plan, accounts=1, cover=0))
        rating = self._prices.rating
        many = math.ceil(left / rating - TIE) - 1 if rating else _MANY
        return replace(plan, cover=min(max(many, 0), _MANY))

    def _changed(self, plans: Iterator[None]) -> Iterator[None]:
        """Change the cheapest successful attacks until no change makes them cheaper.

        An account or a rating is left out. If the attack then fails, other ratings change in round,
        in value, or in the rated agent, as long as the target comes nearer to the edge. Without an
        attack to change, plans are played.
        """
        done, used = set[tuple[Row, ...]](), Counter[int]()
        while True:
            start = min(
                (one for one in self.played.values() if one.success and one.rows not in done),
                key=lambda one: (used[one.accounts], *_worth(one)),
                default=None,
            )
            before = len(self.played)
            if start is None:
                yield from islice(plans, 1)
                if len(self.played) == before:
                    return
            while start:
                done.add(start.rows)
                used[start.accounts] += 1
                start = yield from self._cheaper(start)

    def _cheaper(self, start: Attempt) -> Generator[None, None, Attempt | None]:
        """Play changes of a successful attack; return the first cheaper one that succeeds."""
        rows, now = start.rows, None
        accounts = {
            tuple(sorted(row[:1] + row[2:] for row in of)): of
            for of in _grouped(rows, by_account=True)
        }
        for group in [*accounts.values(), *(group[-1:] for group in _grouped(rows))]:
            if len(group) < len(rows):
                found = yield from self._play(_without(rows, group))
                if found.success:
                    return found
                now = max(now or found, found, key=lambda one: one.margin)
        better = now is not None
        while now and better:
            better = False
            for group, changed in self._changes(now.rows):
                if Counter(group) - Counter(now.rows):
                    continue
                others = sorted([*_without(now.rows, group), *changed])
                if self._ranking.price(others, self._prices) >= start.price - TIE:
                    continue
                found = yield from self._play(others)
                if found.success:
                    return found
                if found.margin > now.margin + TIE:
                    now, better = found, True
        return None

    def _changes(self, rows: Sequence[Row]) -> Iterator[tuple[list[Row], list[Row]]]:
        """Yield changes of ratings that differ in the account alone, at once and one by one: the
        ratings that go, and those that come.
        """
        groups = _grouped(rows)
        some = [*(group for group in groups if len(group) > 1), *(group[:1] for group in groups)]
        found = [(group, change) for group in some for change in self._options(group[0])]
        for at in self._rng.permutation(len(found)).tolist():
            group, change = found[at]
            yield group, [row._replace(**change) for row in group]

    def _options(self, row: Row) -> list[dict[str, Any]]:
        """Return changes of a rating."""
        ranking, place = self._ranking, self.target.place
        values = (min(1.0, max(0.0, row.value + shift)) for shift in _SHIFTS)
        found: list[dict[str, Any]] = [
            *({"round": row.round + shift} for shift in (1, -1) if 0 <= row.round + shift < LAST),
            *({"value": value} for value in values if value != row.value),
        ]
        if row.agent != place:
            others = [*ranking.rivals(self.target, _DECOYS), *ranking.popular[:_DECOYS].tolist()]
            agents = self._rng.permutation(others)[:4].tolist()
            found += [{"agent": at, "value": float(ranking.trust[at])} for at in agents]
            found.append({"agent": place, "value": float(self.target.goal != "sink")})
        return [change for change in found if change.get("agent") not in (row.agent, row.account)]


def _grouped(rows: Sequence[Row], *, by_account: bool = False) -> list[list[Row]]:
    """Return ratings in groups that differ in the account alone, or in all else."""
    groups: dict[Any, list[Row]] = {}
    for row in rows:
        key = row.account if by_account else (row.round, row.agent, row.value)
        groups.setdefault(key, []).append(row)
    return list(groups.values())


def _without(rows: Sequence[Row], group: Sequence[Row]) -> list[Row]:
    """Return ratings without those of a group."""
    return list((Counter(rows) - Counter(group)).elements())


def _worth(one: Attempt) -> tuple[float, float]:
    """Return the price and, of equals, minus the margin: the better attack has less."""
    return round(one.price / TIE) * TIE, -one.margin


def _near(plan: Plan) -> list[Plan]:
    """Return the plans that differ from one in a number or two, by one."""
    changes = [{name: shift} for name in _CHOICES for shift in (1, -1)]
    changes += [{"strikes": more, "cover": less} for more, less in ((1, -1), (-1, 1), (1, 1))]
    return [
        replace(plan, **{name: max(0, getattr(plan, name) + shift) for name, shift in one.items()})
        for one in changes
    ]


def search_attacks(
    searches: Sequence[Search], budget: int, advance: Callable[[float], None]
) -> None:
    """Play the attacks of searches in turn, so many of each.

    Args:
        searches: Searches on one ranking.
        budget: Greatest number of attacks of a search.
        advance: Function that is called with the share of the attacks that were played.
    """
    running = [search.steps() for search in searches]
    for number in range(budget):
        if number % (2 * BLOCK) == 0:
            plans = [replace(search.plan, accounts=1) for search in searches if search.plan]
            for search in searches:
                search.shapes += dict.fromkeys(plans)
        for steps in running:
            next(steps, None)
        advance((number + 1) / budget)
