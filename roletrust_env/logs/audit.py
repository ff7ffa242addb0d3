"""How cheaply a log's ranking is pushed: the cheapest attacks that a search finds, and what hostile
accounts move.

An attack joins the last rounds of the log, beside its ratings, and counts by the ranks at the end.
The search sees these ranks, as an attacker would who knows the log and the model. So a price is a
bound from above on that of the cheapest attack: there may be a cheaper one.
"""

import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from pydantic import TypeAdapter

from roletrust_env.logs.audit_ranking import (
    ACCOUNTS,
    GOALS,
    ORIGINS,
    Attempt,
    Goal,
    Origin,
    Prices,
    Ranking,
    Sent,
    Target,
)
from roletrust_env.logs.audit_search import ROUNDING, SIMPLE, search_attacks
from roletrust_env.logs.evidence import Rank
from roletrust_env.logs.forecasts import forecasts, next_rating
from roletrust_env.logs.log_rounds import log_rounds
from roletrust_env.metrics.confidence import Interval
from roletrust_env.metrics.resampling import interval, mean_intervals
from roletrust_env.trust.key_index import Floats

SHORT = 60
"""Number of attacks on each target by which models are compared."""

_POINTS = 24  # most points of a curve


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
        places: Mean number of ranks that the best of the simple plans moves a target, with an
            interval over targets.
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
        places: Mean of the greatest number of ranks that a target moves, with an interval over
            targets.
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
        medians: Median price of the cheapest attacks for each goal, with an interval over targets;
            infinite if for half of the targets none was found.
        movements: What numbers of accounts move.
        curve: What attacks reach by their price.
        agreement: Share of the targets for which the searches from all seeds found the same price.
        apart: Greatest difference of these prices, as a share of the lower one; NaN without two
            prices.
        played: Number of attacks that were played.
    """

    ranked: int
    exposures: list[Exposure]
    medians: dict[Goal, Interval]
    movements: list[Movement]
    curve: list[CurvePoint]
    agreement: float
    apart: float
    played: int


@dataclass(frozen=True)
class Comparison:
    """What a model comes to beside others, on one log.

    Attributes:
        medians: Median price of the cheapest attacks for each goal, by a short search that is the
            same for each model.
        forecast: How well it forecasts the next ratings, see `next_rating`.
    """

    medians: dict[Goal, Interval]
    forecast: dict[str, Interval]


@dataclass(frozen=True)
class AuditReport:
    """The audit of a trust model on a log, as it is written to a file.

    Attributes:
        format: Name and version of this form.
        log: Name of the log.
        ratings: Number of its ratings.
        every: Length of a round; None if rounds are by number.
        top: Number of agents in the top.
        rank_by: What agents are ranked by: `low`, the lower end of the interval of trust, or
            `trust`.
        prices: Prices of an account, of a hijacked account, of a rating, and of a day.
        budget: Number of attacks that a search plays for each target.
        seeds: Seeds of the searches.
        model: Name of the trust model.
        audit: What is found about it.
        compared: The model beside others.
    """

    log: str
    ratings: int
    every: float | None
    top: int
    rank_by: Rank
    prices: Prices
    budget: int
    seeds: tuple[int, ...]
    model: str
    audit: Audit
    compared: dict[str, Comparison]
    format: str = "roletrust-audit-1"

    def json(self) -> bytes:
        """Return the report as JSON; what is infinite or undefined is null."""
        return TypeAdapter(AuditReport).dump_json(self, indent=2)

    @staticmethod
    def schema() -> dict[str, Any]:
        """Return the JSON Schema of reports."""
        schema = json.dumps(TypeAdapter(AuditReport).json_schema(mode="serialization"))
        found: dict[str, Any] = json.loads(
            schema.replace('"type": "number"', '"type": ["number", "null"]')
        )
        return found


def attack_count(targets: int, budget: int, seeds: int) -> int:
    """Return the greatest number of attacks that an audit of so many targets plays."""
    return targets * (budget * seeds + len(SIMPLE) * len(ACCOUNTS))


def audit_model(
    ranking: Ranking,
    prices: Prices,
    *,
    targets: int = 10,
    named: Sequence[str] = (),
    budget: int = 120,
    seeds: Sequence[int] = (0, 1),
    advance: Callable[[float], None] = lambda share: None,
) -> Audit:
    """Search for the cheapest attacks on a log's ranking, and play simple ones with given numbers
    of accounts.

    Args:
        ranking: Log with its ranks.
        prices: What accounts and ratings cost.
        targets: Number of ranked agents that are drawn as targets from those below the top.
        named: Names of the targets, in place of the top, of those that are drawn, and of a
            newcomer.
        budget: Number of attacks that a search plays for each target.
        seeds: Random seed of each search; the first one also draws targets and resamples.
        advance: Function that is called with the share of the work that is done.
    """
    chosen, done = ranking.targets(targets, seeds[0], named), itertools.count(1)
    whole = attack_count(len(chosen), budget, len(seeds))

    def tick() -> None:
        advance(next(done) / whole)

    runs = [search_attacks(ranking, chosen, prices, budget, seed, tick) for seed in seeds]
    exposures, trials = [], list[_Trials]()
    for target, *searches in zip(chosen, *runs, strict=True):
        best = min(searches, key=lambda search: search.price)
        prices_found = tuple(search.price for search in searches)
        sent = ranking.sent(best.rows)
        exposures.append(
            Exposure(target.goal, *ranking.named(target), best.best, sent, prices_found)
        )
        played = {plan: one for search in searches for plan, one in search.played.items()}
        for plan in (replace(shape, accounts=n) for shape in SIMPLE for n in ACCOUNTS):
            if plan not in played:
                tick()
                played[plan] = ranking.play(target, plan, prices)
        descended = [one for search in searches for one in search.descended]
        trials.append(_Trials(target, ranking, [*played.values(), *descended]))
    advance(1.0)
    goals = [goal for goal in GOALS if any(target.goal == goal for target in chosen)]
    return Audit(
        ranked=len(ranking.order),
        exposures=sorted(exposures, key=lambda one: (GOALS.index(one.goal), one.price)),
        medians=_medians([(one.goal, one.price) for one in exposures], seeds[0]),
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
            np.mean(
                [
                    max(one.prices) - one.price < ROUNDING or one.price == math.inf
                    for one in exposures
                ]
            )
        ),
        apart=max(
            (max(one.prices) / one.price - 1 for one in exposures if 0 < one.price < math.inf),
            default=math.nan,
        ),
        played=sum(len(one.played) for one in trials),
    )


class _Trials(NamedTuple):
    """The attacks that were played on a target."""

    target: Target
    ranking: Ranking
    played: list[Attempt]

    def reach(self, chosen: Callable[[Attempt], bool]) -> tuple[float, bool]:
        """Return the greatest number of ranks that chosen attacks move the target, and whether one
        pushes it over.
        """
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
    """Return the means over the targets of a goal of what chosen attacks reach, see
    `_Trials.reach`.
    """
    found = np.array([one.reach(chosen) for one in trials if one.target.goal == goal], np.float64)
    places, pushed = mean_intervals(found, seed)
    return places, pushed


def compare_models(
    ranking: Ranking,
    name: str,
    others: Mapping[str, Any],
    prices: Prices,
    *,
    targets: int,
    seed: int,
    most: int,
    advance: Callable[[float], None] = lambda share: None,
) -> dict[str, Comparison]:
    """Compare the model of a ranking with the others that forecast best: how cheaply each is pushed
    by a short search.

    Args:
        ranking: Log with its ranks.
        name: Name of the model.
        others: Other models, by name.
        prices: What accounts and ratings cost.
        targets: See `audit_model`.
        seed: Random seed of targets, search and resamples.
        most: Number of other models: those whose forecasts have the highest correlation with the
            ratings.
        advance: Function that is called with the share of the work that is done.

    Returns:
        The comparison of each model, that of the ranking first; none if a log has no rounds by
        time, or a single one.
    """
    log, same = ranking.log, ranking.same_agents
    if ranking.every is None or log_rounds(log, ranking.every)[-1] == 0:
        return {}
    models = {name: ranking.model, **{one: model for one, model in others.items() if one != name}}
    found = {}
    for one, model in models.items():
        with suppress(MemoryError):
            found[one] = next_rating(
                forecasts(model, log, ranking.every, same_agents=same), log, seed
            )
    best = sorted(
        found.keys() - {name},
        key=lambda one: (-np.nan_to_num(found[one]["r"].value, nan=-1.0), one),
    )[:most]
    compared = dict[str, Comparison]()
    for at, one in enumerate(chosen := [one for one in (name, *best) if one in found], 1):
        there = ranking if one == name else ranking.of(models[one])
        searches = search_attacks(
            there, there.targets(targets, seed), prices, SHORT, seed, lambda: None
        )
        compared[one] = Comparison(
            _medians([(search.target.goal, search.price) for search in searches], seed), found[one]
        )
        advance(at / len(chosen))
    return compared


def _medians(found: Sequence[tuple[Goal, float]], seed: int) -> dict[Goal, Interval]:
    """Return the median of the prices of each goal."""
    return {
        goal: _median([price for one, price in found if one == goal], seed) for goal, _ in found
    }


def _median(prices: Sequence[float], seed: int) -> Interval:
    """Return the median of prices, some of which may be infinite, with its interval."""
    ordered = np.sort(prices)

    def place(weights: Floats) -> float:
        total = np.cumsum(weights)
        return float(np.searchsorted(total, total[-1] / 2))

    found = interval(place, np.arange(len(ordered)), seed)
    return Interval(*(math.nan if math.isnan(end) else float(ordered[round(end)]) for end in found))
