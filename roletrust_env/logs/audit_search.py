"""The search for the cheapest attack on a log's ranking.

It plays plans first, and then changes the ratings of the cheapest ones. It sees the ranks, as an
attacker would who knows the log and the model.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from roletrust_env.logs.audit_ranking import (
    LAST,
    MOST,
    ORIGINS,
    Attempt,
    Plan,
    Prices,
    Ranking,
    Row,
    Target,
)

_STEPS = 0.6  # share of steps from the best among the plans that are drawn
_SPENT = 0.5  # share of the drawn plans that cost nearly as much as the best
_MANY = 20  # most decoys of these
ROUNDING = 1e-9
"""Difference of prices that does not count."""

_STARTS = 2  # cheapest attacks whose ratings are changed
_SHIFTS = (-0.3, -0.1, -0.03, 0.03, 0.1, 0.3)  # of a rating
_DECOYS = 8  # agents that a rating may be turned to, of either kind

SIMPLE = (
    Plan(),
    Plan(strikes=3),
    Plan(cover=3),
    Plan(strikes=6, cover=10, popular=False),
    Plan(rivals=2),
    Plan("aged", age=1, cover=2),
    Plan("aged", age=2, cover=6, strikes=2),
    Plan("aged", age=10, cover=10),
    Plan("hijacked"),
    Plan("hijacked", choice=1),
    Plan("hijacked", choice=2),
    Plan("hijacked", strikes=3),
)
"""Plans that every search tries first, and by which numbers of accounts are compared."""

_CHOICES: dict[str, tuple[Any, ...]] = {
    "origin": ORIGINS,
    "strikes": (1, 2, 3, 4, 5, 6, 9),
    "turns": (False, True),
    "quiet": (0, 0, 1, 3),
    "age": (1, 2, 4, 8),
    "mildness": (0.0, 0.0, 0.1, 0.2, 0.3, 0.4),
    "cover": (0, 0, 1, 2, 3, 4, 6, 10),
    "popular": (True, False),
    "rivals": (0, 0, 1, 2, 5),
    "ring": (0, 0, 1, 3),
    "choice": (0, 1, 2),
}


class Search:
    """A search for the cheapest attack on one target.

    Attributes:
        target: Target.
        played: Attacks that were played, by their plan; all of their ratings are sent.
        best: The cheapest attack that pushes the target over the edge; None if none was found.
        rows: Its ratings.
        descended: Attacks that were played with other ratings than those of a plan.
    """

    def __init__(
        self,
        ranking: Ranking,
        target: Target,
        prices: Prices,
        seed: tuple[int, ...],
        tick: Callable[[], None],
    ) -> None:
        self.target, self.played, self.rows = target, dict[Plan, Attempt](), list[Row]()
        self.best: Attempt | None = None
        self.descended = list[Attempt]()
        self._ranking, self._prices, self._rng, self._tick = (
            ranking,
            prices,
            np.random.default_rng(seed),
            tick,
        )

    @property
    def price(self) -> float:
        """The lowest price so far."""
        return self.best.price if self.best else math.inf

    def run(self, known: Sequence[Plan], budget: int) -> None:
        """Play known plans, then steps from the best and drawn plans, until so many attacks were
        played.

        The steps are first those to the plans beside the best, and then drawn.
        """
        shapes, idle = list(known)[::-1], 0
        while len(self.played) < budget and idle < budget:
            before, price = len(self.played), self.price
            self._reduce(shapes.pop() if shapes else self._drawn(), budget)
            if self.best and self.price < price and len(shapes) < len(known):
                shapes += _beside(self.best.plan)
            idle = 0 if len(self.played) > before else idle + 1

    def descend(self, budget: int) -> None:
        """Change the ratings of the cheapest attacks until no change makes them cheaper, or a
        budget is spent.

        An account or a rating is left out. If the attack then fails, other ratings are changed so
        that it comes nearer to the edge, as long as that helps: in round, in value, or in whom they
        are about; those that are alike at once, and one by one.
        """
        cheapest: dict[
            int, Attempt
        ] = {}  # by number of accounts: few accounts and few ratings exclude each other
        for one in sorted(filter(self._over, self.played.values()), key=_worth):
            cheapest.setdefault(one.accounts, one)
        starts = list(cheapest.values())[:_STARTS]
        for number, one in enumerate(starts):
            until = len(self.descended) + (budget - len(self.descended)) // (len(starts) - number)
            rows: list[Row] | None = self._ranking.rows(self.target, one.plan)
            while rows is not None:
                best, rows = rows, self._cheaper(rows, one, until)
                one = self.descended[-1] if rows else one
            if not self.rows or one.price < self.price - ROUNDING:
                self.best, self.rows = one, best

    def _cheaper(self, rows: list[Row], one: Attempt, until: int) -> list[Row] | None:
        """Return the ratings of a cheaper attack, which was the last to be played; None if none is
        found.
        """
        near: tuple[float, list[Row]] = -math.inf, []
        account = max(row.account for row in rows)
        smaller = [row for row in rows if row.account != account]
        for fewer in [smaller, *(_without(rows, group) for group in _alike(rows))]:
            if fewer and len(self.descended) < until:
                found = self._try(one.plan, fewer)
                if self._over(found):
                    return fewer
                near = max(near, (found.margin, fewer))
        margin, rows = near
        better = bool(rows)
        while better:
            better = False
            for group, changed in self._changes(rows):
                if len(self.descended) >= until:
                    return None
                if not group <= Counter(rows):
                    continue
                others = sorted([*(Counter(rows) - group).elements(), *changed])
                if self._ranking.price(others, self._prices) >= one.price - ROUNDING:
                    continue
                found = self._try(one.plan, others)
                if self._over(found):
                    return others
                if found.margin > margin + ROUNDING:
                    margin, rows, better = found.margin, others, True
        return None

    def _changes(self, rows: list[Row]) -> Iterator[tuple[Counter[Row], list[Row]]]:
        """Yield changes of ratings, each with the ratings that it takes away and those that replace
        them.
        """
        groups = _alike(rows)
        order = self._rng.permutation(len(groups)).tolist()
        for group in [
            *(groups[at] for at in order if len(groups[at]) > 1),
            *(groups[at][:1] for at in order),
        ]:
            for change in self._options(group[0]):
                yield Counter(group), [row._replace(**change) for row in group]

    def _options(self, row: Row) -> list[dict[str, Any]]:
        """Return changes of a rating."""
        down, ranking = self.target.goal == "sink", self._ranking
        found: list[dict[str, Any]] = [
            {"round": at} for at in (row.round + 1, row.round - 1) if 0 <= at < LAST
        ]
        values = (min(1.0, max(0.0, row.value + shift)) for shift in _SHIFTS)
        found += [{"value": value} for value in values if value != row.value]
        if row.agent != self.target.place:
            edge = self._rng.permutation(ranking.rivals(self.target, _DECOYS))[:2].tolist()
            some = self._rng.permutation(ranking.popular[:_DECOYS])[:2].tolist()
            found += [
                {"agent": at, "value": float(ranking.trust[at])}
                for at in [*edge, *some]
                if at != row.agent
            ]
            found += [{"agent": at, "value": float(down)} for at in edge[:1]]
            found.append({"agent": self.target.place, "value": float(not down)})
        return [change for change in found if change.get("agent", row.agent) != row.account]

    def _try(self, plan: Plan, rows: list[Row]) -> Attempt:
        self._tick()
        found = self._ranking.play(self.target, plan, self._prices, rows)
        self.descended.append(found)
        return found

    def _over(self, one: Attempt) -> bool:
        return self._ranking.over_edge(self.target, one.rank)

    def _reduce(self, shape: Plan, budget: int) -> None:
        """Play a plan with the most accounts that cost no more than the best; if it succeeds, with
        fewer.
        """
        low, high = 0, self._affordable(shape)
        if not high or not self._succeeds(replace(shape, accounts=high)):
            return
        while high - low > 1 and len(self.played) < budget:
            middle = (low + high) // 2
            if self._succeeds(replace(shape, accounts=middle)):
                high = middle
            else:
                low = middle

    def _affordable(self, shape: Plan) -> int:
        """Return the greatest number of accounts with no higher price than that of the best; 0 if
        there is none.
        """
        if self.best is None:
            return MOST
        price = self._ranking.price(
            self._ranking.rows(self.target, replace(shape, accounts=1)), self._prices
        )
        return MOST if price <= 0 else max(0, min(MOST, math.floor(self.price / price + ROUNDING)))

    def _succeeds(self, plan: Plan) -> bool:
        """Play a plan, and return whether it pushes the target over the edge."""
        if plan not in self.played:
            self._tick()
            self.played[plan] = found = self._ranking.play(self.target, plan, self._prices)
            if self._over(found) and (self.best is None or _worth(found) < _worth(self.best)):
                self.best = found
        return self._over(self.played[plan])

    def _drawn(self) -> Plan:
        """Return a step from the best plan in one or two of its numbers, or a plan of which all are
        drawn.
        """
        names, base = list(_CHOICES), Plan()
        if self.best and self._rng.random() < _STEPS:
            base, names = (
                self.best.plan,
                self._rng.choice(names, self._rng.integers(1, 3), replace=False).tolist(),
            )
        plan = _fitting(replace(base, **{name: self._draw(name) for name in names}))
        return self._spent(plan) if self.best and self._rng.random() < _SPENT else plan

    def _spent(self, plan: Plan) -> Plan:
        """Return a plan with as many decoys as a drawn number of accounts can pay for below the
        best price.
        """
        number = int(self._rng.integers(1, self.best.accounts + 1)) if self.best else 1
        bare = replace(plan, accounts=1, cover=0, age=0)
        left = self.price / number - self._ranking.price(
            self._ranking.rows(self.target, bare), self._prices
        )
        many = (
            math.ceil(left / self._prices.rating - ROUNDING) - 1 if self._prices.rating else _MANY
        )
        return _fitting(replace(plan, cover=min(max(many, 0), _MANY)))

    def _draw(self, name: str) -> Any:
        return _CHOICES[name][self._rng.integers(len(_CHOICES[name]))]


def _alike(rows: Sequence[Row]) -> list[list[Row]]:
    """Return ratings in groups that differ in the account alone."""
    groups: dict[Any, list[Row]] = {}
    for row in rows:
        groups.setdefault((row.round, row.agent, row.value), []).append(row)
    return list(groups.values())


def _without(rows: Sequence[Row], group: Sequence[Row]) -> list[Row]:
    """Return ratings without the last one of a group."""
    return list((Counter(rows) - Counter(group[-1:])).elements())


def _worth(one: Attempt) -> tuple[float, float]:
    """Return what the better of two attacks that succeed has less of: the price and, of equals, the
    margin.
    """
    return round(one.price / ROUNDING) * ROUNDING, -one.margin


def _beside(plan: Plan) -> Iterator[Plan]:
    """Yield the plans that differ from one in a number or two, by one, or in a single choice."""
    for name, choices in _CHOICES.items():
        value = getattr(plan, name)
        counts = isinstance(value, int) and not isinstance(value, bool) and name != "choice"
        for other in (value + 1, max(0, value - 1)) if counts else dict.fromkeys(choices):
            if other != value:
                yield _fitting(replace(plan, **{name: other}))
    for more, fewer in (
        (1, -1),
        (-1, 1),
        (1, 1),
    ):  # what one account gives matters as a product of these
        yield _fitting(replace(plan, strikes=plan.strikes + more, cover=max(0, plan.cover + fewer)))


def _fitting(plan: Plan) -> Plan:
    """Return a plan with one spelling of what it does, within the last rounds."""
    plan = replace(plan, quiet=min(plan.quiet, LAST - 2))
    strikes = min(max(plan.strikes, 1), LAST - plan.quiet)
    age = min(plan.age, LAST - plan.quiet - strikes) if plan.origin == "aged" else 0
    if plan.origin == "aged":
        strikes, age = (strikes, age) if age else (strikes - 1 or 1, 1)
    plan = replace(plan, strikes=strikes, age=age, turns=plan.turns and strikes > 1, accounts=1)
    cover = max(plan.cover, int(plan.origin == "aged"))
    return replace(
        plan,
        cover=cover,
        popular=plan.popular or not cover,
        choice=plan.choice if plan.origin == "hijacked" else 0,
    )


def search_attacks(
    ranking: Ranking,
    targets: Sequence[Target],
    prices: Prices,
    budget: int,
    seed: int,
    tick: Callable[[], None],
) -> list[Search]:
    """Search for each target: half of the attacks are plans, of which the last are the best for
    other targets.
    """
    searches, known = [], list(SIMPLE)
    for target in targets:
        search = Search(ranking, target, prices, (seed, target.place), tick)
        search.run(known, budget * 3 // 8)
        searches.append(search)
        known = _shapes(searches, known)
    for search in searches:
        search.run(_shapes(searches, known), budget // 2)
        search.descend(budget - len(search.played))
    return searches


def _shapes(searches: Sequence[Search], known: Sequence[Plan]) -> list[Plan]:
    """Return the best plans of searches, with one account, and known ones."""
    best = (replace(search.best.plan, accounts=1) for search in reversed(searches) if search.best)
    return list(dict.fromkeys([*best, *known]))
