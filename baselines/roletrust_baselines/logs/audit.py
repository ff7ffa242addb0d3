"""How cheaply a log's ranking is pushed: the cheapest attacks that a search finds, and what hostile accounts move.

An attack joins the last rounds of the log, beside its ratings, and counts by the ranks at the end. The search sees
these ranks, as an attacker would who knows the log and the model. So a price is a bound from above on that of the
cheapest attack: there may be a cheaper one.
"""

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from pydantic import TypeAdapter

from roletrust_baselines.logs.ranking import (
    ACCOUNTS,
    GOALS,
    MOST,
    ORIGINS,
    Attempt,
    Goal,
    Origin,
    Plan,
    Prices,
    Ranking,
    Row,
    Sent,
    Target,
)
from roletrust_baselines.logs.replay import ROUNDS
from roletrust_baselines.logs.resampling import interval, mean_intervals
from roletrust_env.data.evidence import Rank
from roletrust_env.metrics.confidence import Interval
from roletrust_env.trust.key_index import Floats

_STEPS = 0.6  # share of steps from the best among the plans that are drawn
_SPENT = 0.5  # share of the drawn plans that cost nearly as much as the best
_MANY = 20  # most decoys of these
_ROUNDING = 1e-9  # of prices
_STARTS = 2  # cheapest attacks whose ratings are changed
_SHIFTS = (-0.3, -0.1, -0.03, 0.03, 0.1, 0.3)  # of a rating
_DECOYS = 8  # agents that a rating may be turned to, of either kind
_POINTS = 24  # most points of a curve

SIMPLE = (
    Plan(),
    Plan(strikes=3),
    Plan(repeats=3),
    Plan(repeats=12, mildness=0.2),
    Plan(cover=3),
    Plan(strikes=2, cover=2),
    Plan(rivals=2),
    Plan("aged", age=1, cover=2),
    Plan("aged", age=2, cover=6, strikes=2),
    Plan("hijacked"),
    Plan("hijacked", choice=1),
    Plan("hijacked", choice=2),
    Plan("hijacked", strikes=3),
)
"""Plans that every search tries first, and by which numbers of accounts are compared."""

_CHOICES: dict[str, tuple[Any, ...]] = {
    "origin": ORIGINS,
    "strikes": (1, 2, 3, 4, 5, 6),
    "repeats": (1, 1, 2, 3, 5, 8, 13, 20),
    "turns": (False, True),
    "quiet": (0, 0, 1, 3),
    "age": (1, 2, 4),
    "mildness": (0.0, 0.0, 0.1, 0.2, 0.3, 0.4),
    "cover": (0, 0, 1, 2, 3, 4, 6, 10),
    "popular": (True, False),
    "rivals": (0, 0, 1, 2, 5),
    "ring": (0, 0, 1, 3),
    "choice": (0, 1, 2),
}


@dataclass(frozen=True)
class Exposure:
    """How cheaply an agent is pushed over the edge of the top.

    Attributes:
        goal: Where it is pushed.
        agent: Name; empty for one that nobody has rated.
        rank: Rank without an attack.
        ratings: Number of its ratings in the log.
        cheapest: Cheapest attack found; None if none was.
        sent: Its ratings.
        prices: Lowest price that the search found from each seed; infinite if none.
    """

    goal: Goal
    agent: str
    rank: int
    ratings: int
    cheapest: Attempt | None
    sent: list[Sent]
    prices: tuple[float, ...]

    @property
    def price(self) -> float:
        """The lowest price; infinite if no attack was found."""
        return self.cheapest.price if self.cheapest else math.inf


@dataclass(frozen=True)
class Movement:
    """How far so many accounts push their targets.

    Attributes:
        goal: Where they push them.
        origin: Origin of the accounts.
        accounts: Number of accounts for each target.
        places: Mean number of ranks that the best of the simple plans moves a target, with an interval over targets.
        pushed: Share of the targets that cross the edge of the top, with an interval over targets.
    """

    goal: Goal
    origin: Origin
    accounts: int
    places: Interval
    pushed: Interval


@dataclass(frozen=True)
class CurvePoint:
    """What all attacks up to a price reach, of those that were played.

    Attributes:
        goal: Where targets are pushed.
        price: Price of the attack on one target.
        places: Mean of the greatest number of ranks that a target moves, with an interval over targets.
        pushed: Share of the targets that cross the edge of the top, with an interval over targets.
    """

    goal: Goal
    price: float
    places: Interval
    pushed: Interval


@dataclass(frozen=True)
class Audit:
    """What is found about one model on one log.

    Attributes:
        ranked: Number of ranked agents.
        exposures: Targets, the cheapest to push first.
        medians: Median price of the cheapest attacks for each goal, with an interval over targets; infinite if for
            half of the targets none was found.
        movements: What numbers of accounts move.
        curve: What attacks reach by their price.
        agreement: Share of the targets for which the searches from all seeds found the same price.
        played: Number of attacks that were played.
    """

    ranked: int
    exposures: list[Exposure]
    medians: dict[Goal, Interval]
    movements: list[Movement]
    curve: list[CurvePoint]
    agreement: float
    played: int


@dataclass(frozen=True)
class AuditReport:
    """Audits of trust models on one log, as they are written to a file.

    Attributes:
        format: Name and version of this form.
        log: Name of the log.
        ratings: Number of its ratings.
        every: Length of a round.
        top: Number of agents in the top.
        rank_by: What agents are ranked by: `low`, the lower end of the interval of trust, or `trust`.
        prices: Prices of an account, of a hijacked account, and of a rating.
        budget: Number of attacks that a search plays for each target.
        seeds: Seeds of the searches.
        models: Audit of each model, the audited one first.
        forecasts: How well each forecasts the next ratings, see `next_rating`.
    """

    log: str
    ratings: int
    every: float
    top: int
    rank_by: Rank
    prices: Prices
    budget: int
    seeds: tuple[int, ...]
    models: dict[str, Audit]
    forecasts: dict[str, dict[str, Interval]]
    format: str = "roletrust-audit-1"

    def json(self) -> bytes:
        """Return the report as JSON; what is infinite or undefined is null."""
        return TypeAdapter(AuditReport).dump_json(self, indent=2)

    @staticmethod
    def schema() -> dict[str, Any]:
        """Return the JSON Schema of reports."""
        schema = json.dumps(TypeAdapter(AuditReport).json_schema(mode="serialization"))
        found: dict[str, Any] = json.loads(schema.replace('"type": "number"', '"type": ["number", "null"]'))
        return found


# --- the search --------------------------------------------------------------------------------------


class _Search:
    """A search for the cheapest attack on one target.

    Attributes:
        target: Target.
        played: Attacks that were played, by their plan; all of their ratings are sent.
        best: The cheapest attack that pushes the target over the edge; None if none was found.
        rows: Its ratings.
        descended: Attacks that were played with other ratings than those of a plan.
    """

    def __init__(self, ranking: Ranking, target: Target, prices: Prices, seed: tuple[int, ...]) -> None:
        self.target, self.played, self.rows = target, dict[Plan, Attempt](), list[Row]()
        self.best: Attempt | None = None
        self.descended = list[Attempt]()
        self._ranking, self._prices, self._rng = ranking, prices, np.random.default_rng(seed)

    @property
    def price(self) -> float:
        """The lowest price so far."""
        return self.best.price if self.best else math.inf

    def run(self, known: Sequence[Plan], budget: int) -> None:
        """Play known plans, then steps from the best and drawn plans, until so many attacks were played.

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
        """Change the ratings of the cheapest attacks until no change makes them cheaper, or a budget is spent.

        An account or a rating is left out. If the attack then fails, other ratings are changed so that it comes nearer
        to the edge, as long as that helps: in round, in value, or in whom they are about; those that are alike at once,
        and one by one.
        """
        cheapest: dict[
            int, Attempt
        ] = {}  # by number of accounts, since few accounts and few ratings exclude each other
        for one in sorted(filter(self._over, self.played.values()), key=_worth):
            cheapest.setdefault(one.accounts, one)
        starts = list(cheapest.values())[:_STARTS]
        for number, one in enumerate(starts):
            until = len(self.descended) + (budget - len(self.descended)) // (len(starts) - number)
            rows: list[Row] | None = self._ranking.rows(self.target, one.plan)
            while rows is not None:
                best, rows = rows, self._cheaper(rows, one, until)
                one = self.descended[-1] if rows else one
            if not self.rows or one.price < self.price - _ROUNDING:
                self.best, self.rows = one, best

    def _cheaper(self, rows: list[Row], one: Attempt, until: int) -> list[Row] | None:
        """Return the ratings of a cheaper attack, which was the last to be played; None if none is found."""
        near: tuple[float, list[Row]] = -math.inf, []
        account = max(row.account for row in rows)
        for fewer in [
            [row for row in rows if row.account != account],
            *(_without(rows, group) for group in _alike(rows)),
        ]:
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
                if (
                    group <= Counter(rows)
                    and self._ranking.price(
                        others := sorted([*(Counter(rows) - group).elements(), *changed]), self._prices
                    )
                    < one.price - _ROUNDING
                ):
                    found = self._try(one.plan, others)
                    if self._over(found):
                        return others
                    if found.margin > margin + _ROUNDING:
                        margin, rows, better = found.margin, others, True
        return None

    def _changes(self, rows: list[Row]) -> Iterator[tuple[Counter[Row], list[Row]]]:
        """Yield changes of ratings, each with the ratings that it takes away and those that replace them."""
        groups = _alike(rows)
        order = self._rng.permutation(len(groups)).tolist()
        for group in [*(groups[at] for at in order if len(groups[at]) > 1), *(groups[at][:1] for at in order)]:
            for change in self._options(group[0]):
                yield Counter(group), [row._replace(**change) for row in group]

    def _options(self, row: Row) -> list[dict[str, Any]]:
        """Return changes of a rating."""
        down, ranking = self.target.goal == "sink", self._ranking
        found: list[dict[str, Any]] = [{"round": at} for at in (row.round + 1, row.round - 1) if 0 <= at < ROUNDS]
        values = (min(1.0, max(0.0, row.value + shift)) for shift in _SHIFTS)
        found += [{"value": value} for value in values if value != row.value]
        if row.agent != self.target.place:
            edge = self._rng.permutation(ranking.rivals(self.target, _DECOYS))[:2].tolist()
            some = self._rng.permutation(ranking.popular[:_DECOYS])[:2].tolist()
            found += [{"agent": at, "value": ranking.decoy(at)} for at in [*edge, *some] if at != row.agent]
            found += [{"agent": at, "value": float(down)} for at in edge[:1]]
            found.append({"agent": self.target.place, "value": float(not down)})
        return [change for change in found if change.get("agent", row.agent) not in (row.account,)]

    def _try(self, plan: Plan, rows: list[Row]) -> Attempt:
        found = self._ranking.play(self.target, plan, self._prices, rows)
        self.descended.append(found)
        return found

    def _over(self, one: Attempt) -> bool:
        return self._ranking.over_edge(self.target, one.rank)

    def _reduce(self, shape: Plan, budget: int) -> None:
        """Play a plan with the most accounts that cost no more than the best; if it succeeds, with fewer."""
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
        """Return the greatest number of accounts with no higher price than that of the best; 0 if there is none."""
        if self.best is None:
            return MOST
        price = self._ranking.price(self._ranking.rows(self.target, replace(shape, accounts=1)), self._prices)
        return MOST if price <= 0 else max(0, min(MOST, math.floor(self.price / price + _ROUNDING)))

    def _succeeds(self, plan: Plan) -> bool:
        """Play a plan, and return whether it pushes the target over the edge."""
        if plan not in self.played:
            self.played[plan] = found = self._ranking.play(self.target, plan, self._prices)
            if self._over(found) and (self.best is None or _worth(found) < _worth(self.best)):
                self.best = found
        return self._over(self.played[plan])

    def _drawn(self) -> Plan:
        """Return a step from the best plan in one or two of its numbers, or a plan of which all are drawn."""
        names, base = list(_CHOICES), Plan()
        if self.best and self._rng.random() < _STEPS:
            base, names = self.best.plan, self._rng.choice(names, self._rng.integers(1, 3), replace=False).tolist()
        plan = _fitting(replace(base, **{name: self._draw(name) for name in names}))
        return self._spent(plan) if self.best and self._rng.random() < _SPENT else plan

    def _spent(self, plan: Plan) -> Plan:
        """Return a plan with as many decoys as a drawn number of accounts can pay for below the best price."""
        number = int(self._rng.integers(1, self.best.accounts + 1)) if self.best else 1
        bare = replace(plan, accounts=1, cover=0, age=0)
        left = self.price / number - self._ranking.price(self._ranking.rows(self.target, bare), self._prices)
        many = math.ceil(left / self._prices.rating - _ROUNDING) - 1 if self._prices.rating else _MANY
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
    """Return what the better of two attacks that succeed has less of: the price and, of equals, the margin."""
    return round(one.price / _ROUNDING) * _ROUNDING, -one.margin


def _beside(plan: Plan) -> Iterator[Plan]:
    """Yield the plans that differ from one in a number or two, by one, or in a single choice."""
    for name, choices in _CHOICES.items():
        value = getattr(plan, name)
        counts = isinstance(value, int) and not isinstance(value, bool) and name != "choice"
        for other in (value + 1, max(0, value - 1)) if counts else dict.fromkeys(choices):
            if other != value:
                yield _fitting(replace(plan, **{name: other}))
    for more, fewer in ((1, -1), (-1, 1), (1, 1)):  # what one account gives matters as a product of these
        yield _fitting(replace(plan, strikes=plan.strikes + more, cover=max(0, plan.cover + fewer)))
        yield _fitting(replace(plan, repeats=plan.repeats + 2 * more, cover=max(0, plan.cover + fewer)))


def _fitting(plan: Plan) -> Plan:
    """Return a plan with one spelling of what it does, within the last rounds."""
    plan = replace(plan, quiet=min(plan.quiet, ROUNDS - 2))
    strikes = min(max(plan.strikes, 1), ROUNDS - plan.quiet)
    age = min(plan.age, ROUNDS - plan.quiet - strikes) if plan.origin == "aged" else 0
    if plan.origin == "aged":
        strikes, age = (strikes, age) if age else (strikes - 1 or 1, 1)
    plan = replace(plan, strikes=strikes, age=age, turns=plan.turns and strikes > 1, accounts=1)
    cover = max(plan.cover, int(plan.origin == "aged"))
    return replace(
        plan,
        repeats=max(plan.repeats, 1),
        cover=cover,
        popular=plan.popular or not cover,
        choice=plan.choice if plan.origin == "hijacked" else 0,
    )


def _searched(ranking: Ranking, targets: Sequence[Target], prices: Prices, budget: int, seed: int) -> list[_Search]:
    """Search for each target: half of the attacks are plans, of which the last are the best for other targets."""
    searches, known = [], list(SIMPLE)
    for target in targets:
        search = _Search(ranking, target, prices, (seed, target.place))
        search.run(known, budget * 3 // 8)
        searches.append(search)
        known = _shapes(searches, known)
    for search in searches:
        search.run(_shapes(searches, known), budget // 2)
        search.descend(budget - len(search.played))
    return searches


def _shapes(searches: Sequence[_Search], known: Sequence[Plan]) -> list[Plan]:
    """Return the best plans of searches, with one account, and known ones."""
    best = (replace(search.best.plan, accounts=1) for search in reversed(searches) if search.best)
    return list(dict.fromkeys([*best, *known]))


def audit_model(
    ranking: Ranking,
    prices: Prices,
    *,
    targets: int = 10,
    budget: int = 240,
    seeds: Sequence[int] = (0, 1),
    advance: Callable[[float], None] = lambda share: None,
) -> Audit:
    """Search for the cheapest attacks on a log's ranking, and play simple ones with given numbers of accounts.

    Args:
        ranking: Log with its ranks.
        prices: What accounts and ratings cost.
        targets: Number of ranked agents that are drawn as targets from those below the top.
        budget: Number of attacks that a search plays for each target.
        seeds: Random seed of each search; the first one also draws targets and resamples.
        advance: Function that is called with the share of the work that is done.
    """
    chosen, runs = ranking.targets(targets, seeds[0]), []
    for number, seed in enumerate(seeds):
        runs.append(_searched(ranking, chosen, prices, budget, seed))
        advance((number + 1) / (len(seeds) + 1))
    exposures, trials = [], list[_Trials]()
    for target, *searches in zip(chosen, *runs, strict=True):
        best = min(searches, key=lambda search: search.price)
        prices_found = tuple(search.price for search in searches)
        sent = ranking.sent(best.rows)
        exposures.append(Exposure(target.goal, *ranking.named(target), best.best, sent, prices_found))
        played = {plan: one for search in searches for plan, one in search.played.items()}
        for plan in (replace(shape, accounts=n) for shape in SIMPLE for n in ACCOUNTS):
            if plan not in played:
                played[plan] = ranking.play(target, plan, prices)
        descended = [one for search in searches for one in search.descended]
        trials.append(_Trials(target, ranking, [*played.values(), *descended]))
    advance(1.0)
    goals = [goal for goal in GOALS if any(target.goal == goal for target in chosen)]
    return Audit(
        ranked=len(ranking.order),
        exposures=sorted(exposures, key=lambda one: (GOALS.index(one.goal), one.price)),
        medians={goal: _median([one.price for one in exposures if one.goal == goal], seeds[0]) for goal in goals},
        movements=[
            Movement(goal, origin, n, *_reach(trials, goal, seeds[0], _simple(origin, n)))
            for goal in goals
            for origin in ORIGINS
            for n in ACCOUNTS
        ],
        curve=[
            CurvePoint(goal, price, *_reach(trials, goal, seeds[0], _up_to(price)))
            for goal in goals
            for price in _grid([one for one in trials if one.target.goal == goal])
        ],
        agreement=float(
            np.mean([max(one.prices) - one.price < _ROUNDING or one.price == math.inf for one in exposures])
        ),
        played=sum(len(one.played) for one in trials),
    )


class _Trials(NamedTuple):
    """The attacks that were played on a target."""

    target: Target
    ranking: Ranking
    played: list[Attempt]

    def reach(self, chosen: Callable[[Attempt], bool]) -> tuple[float, bool]:
        """Return the greatest number of ranks that chosen attacks move the target, and whether one pushes it over."""
        ranks = [one.rank for one in self.played if chosen(one)]
        sign = 1 if self.target.goal == "sink" else -1
        places = max((sign * (rank - self.target.rank) for rank in ranks), default=0)
        return max(0, places), any(self.ranking.over_edge(self.target, rank) for rank in ranks)


def _simple(origin: Origin, accounts: int) -> Callable[[Attempt], bool]:
    shapes = {replace(shape, accounts=accounts) for shape in SIMPLE if shape.origin == origin}
    return lambda one: one.plan in shapes and not one.changed


def _up_to(price: float) -> Callable[[Attempt], bool]:
    return lambda one: one.price <= price


def _grid(trials: Sequence[_Trials]) -> list[float]:
    """Return prices at which the reach of attacks may change, some of many."""
    prices = np.unique([one.price for trial in trials for one in trial.played])
    return np.unique(prices[np.linspace(0, len(prices) - 1, _POINTS).astype(int)]).tolist()  # type: ignore[no-any-return]


def _reach(
    trials: Sequence[_Trials], goal: Goal, seed: int, chosen: Callable[[Attempt], bool]
) -> tuple[Interval, Interval]:
    """Return the means over the targets of a goal of what chosen attacks reach, see `_Trials.reach`."""
    found = np.array([one.reach(chosen) for one in trials if one.target.goal == goal], np.float64)
    places, pushed = mean_intervals(found, seed)
    return places, pushed


def _median(prices: Sequence[float], seed: int) -> Interval:
    """Return the median of prices, some of which may be infinite, with its interval."""
    ordered = np.sort(prices)

    def place(weights: Floats) -> float:
        total = np.cumsum(weights)
        return float(np.searchsorted(total, total[-1] / 2))

    found = interval(place, np.arange(len(ordered)), seed)
    return Interval(*(math.nan if math.isnan(end) else float(ordered[round(end)]) for end in found))
