"""Audits of a log: ranks as `rate` has them, attacks, exact prices, and the search."""

import math
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses

from roletrust_env.logs import rate, write_log
from roletrust_env.logs.audit import AuditReport, audit
from roletrust_env.logs.audit_exact import SEPARABLE, ExactPrices
from roletrust_env.logs.audit_ranking import LAST, Attempt, Journal, Plan, Prices, Ranking, Row
from roletrust_env.logs.audit_search import Search, search_attacks
from roletrust_env.logs.log import Log, TooSmallError, read
from roletrust_env.logs.models import LOG_MODELS, make_log_model
from roletrust_env.logs.shrinkage import Shrinkage
from roletrust_env.trust import make_trust_model
from roletrust_env.trust.run import make_run

MONTH = 2_592_000.0

SHRUNKEN = Shrinkage(0.6, 3)

EXACT = ("mean", "median", "trimmed-mean", "all-time-mean")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    path: Path = tmp_path_factory.mktemp("log") / "ratings.csv.gz"
    write_log(path, members=40, months=9)
    return read(path, scale=(-10, 10), same_agents=True)


def ranking_of(
    log: Log, model: str = "mean", top: int = 10, shrinkage: Shrinkage = SHRUNKEN
) -> Ranking:
    return Ranking(make_trust_model(model), log, MONTH, top=top, shrinkage=shrinkage)


def shrunken_names(log: Log, shrinkage: Shrinkage) -> list[str]:
    """The names of the ratees, those with the best shrunken trust by the mean first."""
    ratees = rate(log, model="mean", every=MONTH).ratees
    estimate = shrinkage.of(ratees["trust"].to_numpy(), ratees["raters"].to_numpy())
    keys = [-ratees["ratings"].to_numpy(), -ratees["trust"].to_numpy(), -estimate]
    return ratees["name"].to_numpy()[np.lexsort(keys)].tolist()


@pytest.mark.parametrize("model", ["mean", "leave-one-out"])
def test_ranks_are_those_of_rate(log: Log, model: str):
    order = ranking_of(log, model, shrinkage=Shrinkage()).order
    rated = rate(log, model=model, every=MONTH)
    assert rated.calibration is None
    assert [log.ratee_names[place] for place in order] == rated.ratees["name"].tolist()


@pytest.mark.parametrize("shrinkage", [Shrinkage(), SHRUNKEN])
def test_the_rank_after_an_attack_is_that_of_the_longer_log(log: Log, shrinkage: Shrinkage):
    ranking = ranking_of(log, shrinkage=shrinkage)
    target = ranking.targets(1, 0)[3]
    rows = ranking.rows(target, Plan(hijacked=True, accounts=4, strikes=2))
    assert log.times is not None
    month = int(MONTH) * 10**9
    last = np.unique((log.times - log.times[0]) // month)[::-1]
    place = {name: at for at, name in enumerate(log.rater_names)}
    added = [
        (
            place[one.account],
            place[one.agent],
            one.value,
            log.times[0] + last[one.round - 1] * month + 1,
        )
        for one in ranking.sent(rows)
    ]
    raters, ratees, values, times = (
        np.append(a, b) for a, b in zip(log[:4], zip(*added, strict=True), strict=True)
    )
    order = np.argsort(times, kind="stable")
    longer = log._replace(
        raters=raters[order].astype(int),
        ratees=ratees[order].astype(int),
        values=values[order],
        times=times[order].astype(int),
    )
    attempt = ranking.play(target, rows, Prices(hijacked=7, rating=0.5, day=0.01))
    expected = shrunken_names(longer, shrinkage).index(log.ratee_names[target.place]) + 1
    assert attempt.rank == expected > target.rank
    assert (len(rows), attempt.accounts, ranking.days(rows)) == (8, 4, 60)
    assert attempt.price == pytest.approx(4 * 7 + 8 * 0.5 + 60 * 0.01)


def test_a_plan_sends_what_it_says(log: Log):
    ranking = ranking_of(log)
    lifted = ranking.targets(1, 0)[-2]
    plan = Plan(accounts=3, strikes=2, quiet=1, age=2, cover=5, rivals=2)
    rows = ranking.rows(lifted, plan)
    struck = [(row.round, row.value) for row in rows if row.agent == lifted.place]
    assert struck == [(LAST - 3, 1.0)] * 3 + [(LAST - 2, 1.0)] * 3
    pushed = [row for row in rows if row.value == 0.0]
    assert {row.agent for row in pushed} == set(ranking.order[8:10].tolist())
    assert len(pushed) == 3 * 2 * 2
    decoys = [row for row in rows if row.round < LAST - 3]
    assert [row.round for row in decoys] == [LAST - 5] * 9 + [LAST - 4] * 6
    assert all(row.value == ranking.trust[row.agent] for row in decoys)
    assert {row.account for row in rows} == set(range(ranking.fresh, ranking.fresh + 3))
    raters = {row.account for row in ranking.rows(lifted, replace(plan, hijacked=True))}
    assert raters & set(log.raters[log.ratees == lifted.place].tolist())


def tiny(seed: int, rounds: int, *, same_agents: bool) -> Log:
    """A log of three ratees with a few ratings in each round; no two sums of ratings are alike."""
    rng = np.random.default_rng(seed)
    edges = [
        (number, rater, ratee)
        for number in range(rounds)
        for rater, ratee in product(range(3), range(3))
        if rater != ratee and (rng.random() < 0.5 or (number, rater) == (0, (ratee + 1) % 3))
    ]
    numbers, raters, ratees = np.array(edges).T
    names = ["a", "b", "c"]
    times = numbers * int(MONTH) * 10**9
    values = rng.uniform(0.05, 0.95, len(edges))
    others = names if same_agents else ["A", "B", "C"]
    return Log(raters, ratees, values, times, names, others)


PAID = Prices(account=0.2, hijacked=0.25, rating=0.1)


def played(
    ranking: Ranking, goal: str, rows: list[Row], most: int, prices: Prices
) -> dict[float, bool]:
    """Whether any attack of so many of some ratings succeeds, by its price."""
    target = {one.goal: one for one in ranking.targets(1, 0)}[goal]  # type: ignore[index]
    found = dict[float, bool]()
    for number in range(1, most + 1):
        for some in combinations(rows, number):
            if len({row[:3] for row in some}) == number:
                attempt = ranking.play(target, some, prices)
                found[attempt.price] = found.get(attempt.price, False) or attempt.success
    return found


@pytest.mark.parametrize("model", EXACT)
@settings(max_examples=8, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    goal=st.sampled_from(["sink", "lift", "enter"]),
    weight=st.sampled_from([0.0, 2.0]),
    day=st.sampled_from([0.0, 0.002]),
    same_agents=st.booleans(),
)
def test_no_attack_is_below_the_exact_price_and_one_is_at_it(
    model: str, seed: int, goal: str, weight: float, day: float, same_agents: bool
):
    log = tiny(seed, 2, same_agents=same_agents)
    shrinkage = Shrinkage(0.5, weight)
    ranking = Ranking(make_log_model(model), log, MONTH, top=1, shrinkage=shrinkage)
    target = {one.goal: one for one in ranking.targets(1, 0)}[goal]  # type: ignore[index]
    prices = replace(PAID, day=day)
    exact = ExactPrices(ranking, prices)
    (price, rows), (strict, _) = (exact.cheapest(target, strict=tie) for tie in (False, True))
    agents = [*range(3), ranking.newcomer]
    options = [
        [
            Row(at, account, agent, value)
            for at, agent, value in product((LAST - 2, LAST - 1), agents, (0.0, 1.0))
        ]
        for account in (ranking.fresh, ranking.fresh + 1)
    ]
    found = played(
        ranking, goal, options[0], 3, prices
    )  # all attacks below 0.6, but for two accounts
    for pair in product(*options):
        attempt = ranking.play(target, pair, prices)
        found[attempt.price] = found.get(attempt.price, False) or attempt.success
    cheapest = min([*(price for price, success in found.items() if success), 0.6])
    assert min(price, 0.6) - 1e-9 <= cheapest
    assert min(strict, 0.6) + 1e-9 >= cheapest
    if rows and price < strict + 1e-9:  # there is no tie
        attempt = ranking.play(target, rows, prices)
        assert attempt.success == (price == pytest.approx(strict))
        assert attempt.price == pytest.approx(price)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), goal=st.sampled_from(["sink", "lift"]))
def test_no_attack_of_hijacked_accounts_is_below_the_lower_bound(seed: int, goal: str):
    log = tiny(seed, 2, same_agents=False)
    ranking = Ranking(make_log_model("mean"), log, MONTH, top=1)
    every = {"every": MONTH, "top": 1, "targets": 1, "budget": 1, "shrinkage": Shrinkage()}
    prices = replace(PAID, hijacked=0.05)
    report = audit(log, model="mean", prices=prices, **every)
    (lower,) = (one.lower for one in report.exposures if one.goal == goal)
    rows = [Row(*row) for row in product((LAST - 2, LAST - 1), (0, 1), range(3), (0.0, 1.0))]
    found = played(ranking, goal, rows, 2, prices)
    assert lower <= min([price for price, success in found.items() if success], default=math.inf)


def test_the_exact_models_are_separable_and_monotone():
    made = {name: make_log_model(name) for name in (*EXACT, "beta", *LOG_MODELS)}
    assert {name for name, model in made.items() if type(model) in SEPARABLE} == set(EXACT)
    rng = np.random.default_rng(0)
    for name in EXACT:
        for _ in range(50):
            trust = []
            rounds = [rng.random(rng.integers(1, 5)) for _ in range(3)]
            higher = [
                np.minimum(1.0, one + rng.random(len(one)) * (rng.random() < 0.5)) for one in rounds
            ]
            more = [np.append(one, 1.0) if rng.random() < 0.5 else one for one in rounds]
            for values in (rounds, rounds, higher, more):
                run = make_run(made[name], (12, 2))
                for one in values:
                    who, others = rng.permutation(12)[: len(one)], rng.integers(1, 12)
                    raters = np.append(who, rng.permutation(12)[:others])
                    ratees = np.append(np.zeros(len(one), int), np.ones(others, int))
                    run.play(raters, ratees, np.append(one, rng.random(others)))
                trust.append(run.provider_trust[0])
            assert trust[0] == pytest.approx(trust[1], abs=1e-12)
            assert min(trust[2:]) >= trust[0] - 1e-12


def searched(log: Log, budget: int) -> list[Search]:
    ranking = ranking_of(log, "leave-one-out")
    prices = Prices(hijacked=2.0, rating=0.03)
    searches = [Search(ranking, target, prices, 1) for target in ranking.targets(3, 0)[8:]]
    search_attacks(searches, budget, lambda share: None)
    return searches


def test_a_larger_budget_continues_a_smaller_one(log: Log):
    before: list[list[Attempt]] = [[] for _ in searched(log, 1)]
    prices = [math.inf] * len(before)
    assert len(before) == 6
    for budget in (1, 5, 20, 40, 70, 100, 130, 150, 180, 220):
        found = searched(log, budget)
        attempts = [list(search.played.values()) for search in found]
        assert max(map(len, attempts)) == budget
        for now, earlier in zip(attempts, before, strict=True):
            assert now[: len(earlier)] == earlier
        assert all(
            search.price <= price + 1e-9 for search, price in zip(found, prices, strict=True)
        )
        before, prices = attempts, [search.price for search in found]
    assert sum(math.isfinite(price) for price in prices) >= 3
    assert sum(len(attempts) > 60 for attempts in before) >= 3  # beyond a shared checkpoint


@pytest.fixture(scope="module")
def report(log: Log) -> AuditReport:
    return audited(log)


def audited(log: Log) -> AuditReport:
    prices = Prices(day=0.001)
    return audit(log, model="leave-one-out", every=MONTH, prices=prices, targets=3, budget=60)


def test_every_rating_of_a_found_attack_is_sent_and_priced(log: Log, report: AuditReport):
    ranking = ranking_of(log, "leave-one-out", shrinkage=Shrinkage())
    targets = {target[::2]: target for target in ranking.targets(3, 0)}
    place = {name: at for at, name in enumerate(log.rater_names)}
    place |= {f"new account {n + 1}": ranking.fresh + n for n in range(30)}
    place["newcomer"] = ranking.newcomer
    assert len(report.exposures) == 14
    for one in report.exposures:
        target = targets[one.goal, one.rank]
        rows = [Row(LAST - s.round, place[s.account], place[s.agent], s.value) for s in one.sent]
        attempt = ranking.play(target, rows, report.prices)
        assert attempt.success
        assert attempt.price == one.upper
        assert attempt.accounts == one.accounts == len({sent.account for sent in one.sent})
        hijacked = len({row.account for row in rows if row.account < ranking.newcomer})
        bought = one.accounts - hijacked + 10 * hijacked + 0.1 * len(rows)
        assert one.upper == pytest.approx(bought + 0.001 * one.days)
        single = ranking.play(target, ranking.rows(target, Plan()), report.prices)
        assert not single.success or one.upper <= single.price


def test_medians_and_curves_leave_out_the_border_of_the_top(log: Log, report: AuditReport):
    assert {one.rank for one in report.exposures if one.border} <= {9, 10, 11, 12}
    assert {9, 10} <= {one.rank for one in report.exposures if one.border}
    for goal, median in report.medians.items():
        prices = sorted(
            one.upper for one in report.exposures if one.goal == goal and not one.border
        )
        assert median.value == prices[(len(prices) - 1) // 2]
        assert math.isnan(median.low) == (len(prices) == 1)
        curve = [(one.price, one.pushed.value) for one in report.curve if one.goal == goal]
        shares = [(price, np.mean(np.array(prices) <= price)) for price in dict.fromkeys(prices)]
        assert curve == shares
    assert repr(audited(log)) == repr(report)


def test_bounds_are_equal_for_a_separable_model_and_unknown_for_others(
    log: Log, report: AuditReport
):
    found = audit(log, model="mean", every=MONTH, targets=3, budget=1)
    assert [one.gap for one in found.exposures] == [pytest.approx(0)] * 14
    assert found.played == 14
    least = 1.1 + 30 * 0.001
    for one in report.exposures:
        assert one.lower == one.upper == least or math.isnan(one.lower)
        assert one.lower == least or one.upper > least
    small = audit(log, model="mean", every=MONTH, targets=1, top=1, budget=1, named=["5"])
    assert [(one.agent, one.border) for one in small.exposures] == [("5", False)]
    assert (small.log, small.shrinkage.weight, small.model) == ("", 0.0, "mean")


def test_targets_may_be_named(log: Log):
    ranking = ranking_of(log)
    best, worst = (log.ratee_names[ranking.order[at]] for at in (0, -1))
    found = ranking.targets(3, 0, [worst, best, best])
    assert [(one.goal, one.rank) for one in found] == [("sink", 1), ("lift", len(ranking.order))]
    with refuses(ValueError, "nobody"):
        ranking.targets(3, 0, ["nobody"])


def test_a_damaged_journal_keeps_its_whole_lines(tmp_path: Path):
    (tmp_path / "journal").write_bytes(
        b'\xff\0["a", 1, 2]\n["b", 3, 0.5]\n["c", "x", null]\n[["d"], 1, 2]\n["e", 1'
    )
    assert Journal(tmp_path / "journal").known == {"b": (3, 0.5)}
    for wrong in (
        "-3, 0.5",
        "0, 0.5",
        "true, 0.5",
        '"3", 0.5',
        "Infinity, 0.5",
        "2.5, 0.5",
        "3, NaN",
        '3, "0.5"',
        "3",
        "[], {}",
    ):
        (tmp_path / "journal").write_text(f'["a", {wrong}]\n["b", 3, 0.5]\n[["c"], 3, 0.5]\n')
        assert Journal(tmp_path / "journal").known == {"b": (3, 0.5)}, wrong


def test_what_cannot_be_audited_is_refused(log: Log):
    with refuses(TooSmallError, "33", "40"):
        ranking_of(log, top=40)
    with refuses(ValueError, "day", "0.5"):
        audit(log, prices=Prices(day=0.5), every=None)
    for name, number in (("top", 0), ("top", 1.5), ("targets", -1), ("budget", 0)):
        with refuses(ValueError, name, number):
            audit(log, **{name: number})
    for text, value in (("acount=1", "acount"), ("rating=-1", "-1"), ("day", "day")):
        with refuses(ValueError, value):
            Prices.parsed(text)
    assert Prices.parsed("rating=2, day=1") == Prices(rating=2.0, day=1.0)


def test_days_are_those_of_the_log_and_not_of_its_rounds_with_ratings() -> None:
    day = 86_400
    columns = {
        "rater": [f"r{n}" for n in range(40)],
        "ratee": [f"s{n % 20}" for n in range(40)],
        "rating": [n % 2 for n in range(40)],
        "time": [(n // 20) * 180 * day for n in range(40)],
    }
    ranking = Ranking(make_trust_model("mean"), read(columns), 30.0 * day, top=3)
    last, before = Row(LAST - 1, 40, 0, 0.0), Row(LAST - 2, 40, 0, 0.0)
    assert (ranking.days([last]), ranking.days([before, last])) == (30, 210)
    assert ranking.days([Row(0, 40, 0, 0.0)]) == 210  # it is in the first round
    assert ranking.days([]) == 0
    assert [sent.round for sent in ranking.sent([last, before])] == [1, 7]
