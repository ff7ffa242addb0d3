"""An audit of the ranking of a log: the price of pushing agents over the edge of the top.

An attack adds ratings to the last rounds of the log, and counts by the ranks at the end.
The attacker knows the log and the model, and sees the ranks.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from roletrust_env.logs.audit_exact import SEPARABLE, TIE, ExactPrices
from roletrust_env.logs.audit_ranking import (
    GOALS,
    LAST,
    Goal,
    Journal,
    Prices,
    Ranking,
    Row,
    Sent,
)
from roletrust_env.logs.audit_search import Search, search_attacks
from roletrust_env.logs.compare import MONTH
from roletrust_env.logs.log import Log, check_log
from roletrust_env.logs.models import AllTimeMean, make_log_model
from roletrust_env.logs.rate import MODEL, Rated, rate
from roletrust_env.logs.shrinkage import Shrinkage
from roletrust_env.metrics.confidence import Interval
from roletrust_env.metrics.resampling import RESAMPLES, mean_intervals
from roletrust_env.parameters import whole_number
from roletrust_env.randomness import generator
from roletrust_env.storage.markdown import ShownAsMarkdown, markdown_table, plain
from roletrust_env.trust.models.central.means import Mean

BORDER = 2
"""Number of ranks on either side of the edge of the top whose agents are reported apart: they are
always cheap to exchange."""

_QUICK = 2_000_000  # updates of a table for the first attacks of a search


@dataclass(frozen=True)
class Exposure:
    """The price of pushing an agent over the edge of the top.

    Attributes:
        goal: Goal of the attack.
        agent: Name; empty for an unrated agent.
        rank: Rank without an attack.
        ratings: Number of its ratings in the log.
        border: Whether its rank is at the edge of the top, see `BORDER`.
        lower: No attack of at most 30 accounts is cheaper; NaN if no such bound is known.
        upper: Price of the cheapest attack found; infinite if none was found.
        accounts: Number of accounts of this attack.
        days: Number of days from its first rating to the end of the log; NaN without times.
        sent: Its ratings.
    """

    goal: Goal
    agent: str
    rank: int
    ratings: int
    border: bool
    lower: float
    upper: float
    accounts: int
    days: float
    sent: list[Sent]

    @property
    def gap(self) -> float:
        """The upper bound minus the lower bound; NaN if one of them is unknown."""
        return self.upper - self.lower if self.upper < math.inf else math.nan


@dataclass(frozen=True)
class CurvePoint:
    """The share of targets that attacks up to a price push over the edge.

    Attributes:
        goal: Goal of the attacks.
        price: Price of the attack on one target.
        pushed: Share of the targets, with an interval over targets.
    """

    goal: Goal
    price: float
    pushed: Interval


@dataclass(frozen=True, repr=False)
class AuditReport(ShownAsMarkdown):
    """The audit of a trust model on a log.

    Medians and curve are of the upper bounds, without the targets at the border of the top where a
    goal has others.

    Attributes:
        log: Name of the log.
        ratings: Number of its ratings.
        every: Length of a round in seconds; None for a single round.
        top: Number of agents in the top.
        shrinkage: How trust is drawn to a mean before agents are ranked.
        prices: Prices of accounts, ratings and days.
        budget: Greatest number of attacks of a search for each target.
        seed: Seed of the search, of drawn targets and of intervals.
        model: Name of the trust model.
        ranked: Number of ranked agents.
        played: Number of attacks that were played.
        exposures: Targets, the cheapest of each goal first.
        medians: Median price for each goal, with an interval over targets.
        curve: Share of targets by price.
        version: Version of RoleTrust.
        format: Name and version of this format.
    """

    log: str
    ratings: int
    every: float | None
    top: int
    shrinkage: Shrinkage
    prices: Prices
    budget: int
    seed: int
    model: str
    ranked: int
    played: int
    exposures: list[Exposure]
    medians: dict[Goal, Interval]
    curve: list[CurvePoint]
    version: str
    format: str = "roletrust-audit-2"

    def _repr_markdown_(self) -> str:
        rows = [(goal, *(f"{value:.4g}" for value in one)) for goal, one in self.medians.items()]
        title = f"Median prices on {plain(self.model)}, top {self.top} of {self.ranked:,} agents"
        table = markdown_table(("goal", "median", "low", "high"), rows, 1)
        return f"{title}\n\n{table}"

    @property
    def table(self) -> Any:
        """The targets as a data frame of pandas, without the ratings that were sent."""
        import pandas as pd

        return pd.DataFrame(self.exposures).drop(columns="sent")

    def json(self) -> bytes:
        """Return the report as JSON; infinite and undefined numbers are null."""
        return TypeAdapter(AuditReport).dump_json(self, indent=2)


def audit(
    log: Log | Rated,
    *,
    model: Any = MODEL,
    every: float | None = MONTH,
    shrinkage: Shrinkage | None = None,
    prices: Prices = Prices(),  # noqa: B008 - immutable
    top: int = 10,
    targets: int = 10,
    named: Sequence[str] = (),
    budget: int = 400,
    seed: int = 0,
    journal: Journal | None = None,
    advance: Callable[[float], None] = lambda share: None,
    name: str = "",
) -> AuditReport:
    """Return the prices at which hostile accounts push agents over the edge of the top.

    Targets are each agent of the top, agents drawn from below it, and an unrated one. For separable
    models the cheapest attack of new accounts is computed and played, see `ExactPrices`. For other
    models, and where hijacked accounts may be cheaper, a search plays attacks.

    Args:
        log: Log; or a `Rated`, whose log, model, rounds and shrinkage are taken.
        model: Trust model, or its name, see `make_log_model`.
        every: Length of a round in seconds, by default 30 days; None for a single round.
        shrinkage: How trust is drawn to a mean before agents are ranked; None: as by `rate`.
        prices: Prices of accounts, ratings and days.
        top: Number of agents in the top.
        targets: Number of agents that are drawn from below the top.
        named: Names of the targets, in place of all others.
        budget: Greatest number of attacks that a search plays for each target.
        seed: Random seed of the search, of drawn targets and of intervals.
        journal: Known outcomes of attacks, from which an interrupted audit continues.
        advance: Function that is called with the share of the search that is done.
        name: Name of the log in the report.

    Raises:
        TooSmallError: The log has too few ranked agents.
        ValueError: The model or a named target is unknown; rounds or days need times, and the log
            has none.
        MemoryError: The model does not fit, see `make_run`.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> from roletrust_env.logs import read, write_log
        >>> from roletrust_env.logs.audit import audit
        >>> path = Path(mkdtemp()) / "log.csv.gz"
        >>> write_log(path)
        >>> log = read(path, scale=(-10, 10), same_agents=True)
        >>> audit(log, model="mean", top=3).medians["lift"].value
        1.3
    """
    title = model if isinstance(model, str) else repr(model)
    if isinstance(log, Rated):
        title, model, every = log.model, log.stream.model, log.stream.every
        shrinkage = log.calibration.shrinkage if log.calibration else Shrinkage()
        log = log.whole_log()
    check_log(log)
    for name_of, number, least in (("top", top, 1), ("targets", targets, 0), ("budget", budget, 1)):
        whole_number(name_of, number, least)
    if prices.day and every is None:
        raise ValueError(
            f"prices.day is {prices.day:g}; without the length of a round it must be 0"
        )
    made = make_log_model(model) if isinstance(model, str) else model
    if shrinkage is None:
        calibration = rate(log, model=made, every=every).calibration
        shrinkage = calibration.shrinkage if calibration else Shrinkage()
    ranking = Ranking(made, log, every, top=top, shrinkage=shrinkage, journal=journal)
    chosen = ranking.targets(targets, seed, named)
    searches = [Search(ranking, target, prices, seed) for target in chosen]
    _begin(ranking, searches, prices)
    left = [search for search in searches if not search.price <= search.lower + TIE]
    search_attacks(left, budget, advance)
    exposures = [_exposure(ranking, search, border=not named) for search in searches]
    goals = [goal for goal in GOALS if any(one.goal == goal for one in exposures)]
    inner = {
        goal: [one.upper for one in exposures if one.goal == goal and not one.border]
        or [one.upper for one in exposures if one.goal == goal]
        for goal in goals
    }
    return AuditReport(
        name,
        len(log.values),
        every,
        top,
        shrinkage,
        prices,
        budget,
        seed,
        title,
        ranked=len(ranking.order),
        played=sum(len(search.played) for search in searches),
        exposures=sorted(exposures, key=lambda one: (GOALS.index(one.goal), one.upper)),
        medians={goal: _median(found, seed) for goal, found in inner.items()},
        curve=[point for goal, found in inner.items() for point in _curve(goal, found, seed)],
        version=version("roletrust-env"),
    )


def _begin(ranking: Ranking, searches: Sequence[Search], prices: Prices) -> None:
    """Play the cheapest attacks on a separable model, which bound the price, or else on the plain
    means, as the first attacks of searches.
    """
    if type(ranking.model) in SEPARABLE:
        exact, hijacked = ExactPrices(ranking, prices), Row(LAST - 1, 0, 0, 0.0)
        for search in searches:
            price, rows = exact.cheapest(search.target)
            search.lower = min(price, ranking.price([hijacked], prices))
            if not search.begin(rows):
                search.begin(exact.cheapest(search.target, strict=True)[1])
        return
    for model in (Mean(), AllTimeMean()):
        plain = Ranking(
            model, ranking.log, ranking.every, top=ranking.top, shrinkage=ranking.shrinkage
        )
        exact, best = ExactPrices(plain, prices, work=_QUICK), plain.order[: ranking.top]
        for search in searches:
            if (search.target.place in best) == (search.target.goal == "sink"):
                search.begin(exact.cheapest(search.target)[1])


def _exposure(ranking: Ranking, search: Search, *, border: bool) -> Exposure:
    """Return the bounds of a target."""
    target, best = search.target, search.best
    names, rows = ranking.log.ratee_names, best.rows if best else ()
    return Exposure(
        target.goal,
        names[target.place] if target.place < len(names) else "",
        target.rank,
        int(ranking.total[target.place]),
        border and abs(target.rank - ranking.top - 0.5) < BORDER,
        search.price if search.price <= search.least + TIE else search.lower,
        search.price,
        best.accounts if best else 0,
        ranking.days(rows) if rows else math.nan,
        ranking.sent(rows),
    )


def _curve(goal: Goal, prices: Sequence[float], seed: int) -> list[CurvePoint]:
    """Return the share of prices up to each of them."""
    steps = sorted({price for price in prices if price < math.inf})
    shares = np.array(prices)[:, None] <= np.array(steps)
    found = mean_intervals(shares.astype(np.float64), seed)
    return [CurvePoint(goal, price, share) for price, share in zip(steps, found, strict=True)]


def _median(prices: Sequence[float], seed: int) -> Interval:
    """Return the median of prices, some of which may be infinite, with its interval."""
    draws = generator(seed).integers(0, len(prices), (RESAMPLES, len(prices)))
    medians = np.percentile(np.array(prices)[draws], 50, axis=1, method="lower")
    ends = np.percentile(medians, [2.5, 97.5], method="nearest").tolist()
    value = float(np.percentile(prices, 50, method="lower"))
    return Interval(value, *(ends if len(prices) > 1 else [math.nan] * 2))
