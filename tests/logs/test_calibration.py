"""What a log's past says about its trust: intervals that cover, and the order that forecasts."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roletrust_env.logs import Log, rate
from roletrust_env.logs.calibration import RATERS, Past, _ends, _p_values, calibrated, cuts, first
from roletrust_env.logs.log_rounds import log_rounds
from roletrust_env.logs.shrinkage import Shrinkage

DAY = 86_400 * 10**9


def community(seed: int, ratings: int, noise: float = 2.0) -> Log:
    """Ratings of agents that differ, of which some are rated far more often."""
    rng, agents, raters = np.random.default_rng(seed), 300, 2_000
    quality, fame = rng.beta(4, 2, agents), rng.pareto(1.0, agents) + 0.2
    ratees = rng.choice(agents, ratings, p=fame / fame.sum())
    values = rng.beta(noise * quality[ratees] + 0.01, noise * (1 - quality[ratees]) + 0.01)
    times = np.sort(rng.integers(0, 1_000 * DAY, ratings))
    names = [str(n) for n in range(raters)]
    whom = [f"a{n}" for n in range(agents)]
    return Log(rng.integers(0, raters, ratings), ratees, values, times, names, whom)


@pytest.mark.parametrize("every", [None, 30 * 86_400.0])
@pytest.mark.parametrize("timed", [True, False])
def test_intervals_cover_later_means(every: float | None, timed: bool) -> None:
    """Of agents with few raters and with many, and their own measure agrees."""
    if every and not timed:
        return
    log = community(0, 12_000)
    past, later = first(log, slice(6_000)), first(log, slice(6_000, None))
    if not timed:
        past = past._replace(times=None)
    rated = rate(past, model="leave-one-out", every=every)
    calibration = rated.calibration
    assert calibration is not None
    assert 0.94 <= calibration.coverage <= 0.98
    assert sum(group.agents for group in calibration.groups) >= 500
    table = rated.ratees.set_index("name")
    count = np.bincount(later.ratees, minlength=300)
    means = np.bincount(later.ratees, later.values, 300) / np.maximum(count, 1)
    known = [name for name in table.index if count[int(name[1:])]]
    means, table = means[[int(name[1:]) for name in known]], table.loc[known]
    covered = (table.low <= means) & (means <= table.high)
    assert 0.9 <= covered.mean() <= 1.0
    few = table.raters < 4
    assert covered[few].mean() >= 0.85
    assert covered[~few].mean() >= 0.85
    widths = (table.high - table.low).groupby(few).mean()
    assert widths[False] < widths[True] < 1.0


def test_shrunken_trust_ranks_if_it_forecasts_better() -> None:
    """As where single ratings say little; not where agents do not differ at all."""
    noisy = rate(community(0, 4_000, noise=1.0), model="all-time-mean").calibration
    assert noisy is not None
    assert noisy.weight > 0.5
    assert noisy.estimate_forecast > noisy.trust_forecast
    alike = community(2, 4_000)
    alike = alike._replace(values=np.random.default_rng(0).random(4_000))
    same = rate(alike, model="all-time-mean").calibration
    assert same is None or abs(same.trust_forecast) < 0.1


def test_too_few_later_ratings_calibrate_nothing() -> None:
    rated = rate(community(0, 60), model="mean")
    assert rated.calibration is None
    assert rated.ratees.low.isna().all()
    assert (rated.ratees.estimate == rated.ratees.trust).all()


def test_cuts_are_where_rounds_end() -> None:
    log = community(0, 500)
    numbers = log_rounds(log, 50 * 86_400.0)
    for cut in cuts(numbers).tolist():
        assert numbers[cut - 1] < numbers[cut]
    assert cuts(np.zeros(500, np.int64)).tolist() == [50 * n for n in range(1, 10)]


def test_a_calibration_is_that_of_a_slow_copy() -> None:
    """And its intervals, of the levels at which they cover 95% of later means."""
    log = community(3, 3_000)
    taken = [300 * n for n in range(1, 10)]
    rng = np.random.default_rng(0)
    pasts = [Past(n, rng.random(300)) for n in taken]
    found = calibrated(log, pasts, Shrinkage(0.5, 3.0))
    assert found is not None

    def residuals(at: int, end: int) -> list[tuple[int, float]]:
        rows = []
        for agent in range(300):
            before = log.ratees[: taken[at]] == agent
            after = log.values[taken[at] : end][log.ratees[taken[at] : end] == agent]
            raters = len(set(log.raters[: taken[at]][before].tolist()))
            if raters and len(after):
                group = max(n for n, least in enumerate(RATERS) if least <= raters)
                trust = float(pasts[at].trust[agent])
                if found.weight:
                    part = first(log, slice(taken[at]))
                    there = np.bincount(part.ratees, minlength=300) > 0
                    fitted = Shrinkage.fitted(part, pasts[at].trust[there])
                    trust = (raters * trust + fitted.weight * fitted.mean) / (
                        raters + fitted.weight
                    )
                rows.append((group, float(after.mean()) - trust))
        return rows

    def nearest(known: list[tuple[int, float]], group: int) -> list[float]:
        near: list[float] = []
        for far in range(len(RATERS)):
            near = [r for g, r in known if abs(g - group) <= far]
            if len(near) >= 100:
                break
        return near

    def level(p: list[tuple[int, float]], group: int) -> float:
        near = sorted(nearest(p, group))
        return min(0.05, np.nextafter(near[int((1 - 0.95) * len(near))], 0)) if near else 0.05

    p, covered = list[tuple[int, float]](), list[bool]()
    for at in range(4, 9):
        new = []
        known = [row for j in range(at) for row in residuals(j, taken[at])]
        for group, residual in residuals(at, 3_000):
            near = nearest(known, group)
            out = min(sum(r <= residual for r in near), sum(r >= residual for r in near))
            new.append((group, min(2 * (out + 1) / (len(near) + 1), 1.0)))
        covered += [one > level(p, group) for group, one in new]
        p += new
    assert found.coverage == pytest.approx(np.mean(covered))
    assert found.weight in (0.0, 3.0)
    rows = [row for j in range(9) for row in residuals(j, 3_000)]
    for number, one in enumerate(found.groups):
        near = sorted(nearest(rows, number))
        out = int(level(p, number) / 2 * (len(near) + 1))
        assert (one.low, one.high) == pytest.approx((near[out - 1], near[-out]))


@given(
    st.lists(st.floats(-1, 1), min_size=100, max_size=150), st.lists(st.floats(-1, 1), min_size=1)
)
def test_an_interval_of_a_level_has_what_its_p_value_exceeds(known: Any, others: Any) -> None:
    zeros = np.zeros(len(known), np.int64)
    p = _p_values((zeros, np.array(known)), np.zeros(len(others), np.int64), np.array(others))
    for level in (0.02, 0.05, 0.3):
        low, high = _ends(np.sort(known), level)
        assert ((low <= np.array(others)) & (np.array(others) <= high)).tolist() == (
            p > level
        ).tolist()


def test_a_shrinkage_is_that_of_the_analysis_of_variance() -> None:
    rng = np.random.default_rng(0)
    quality = rng.normal(0.5, 0.1, 400)
    ratees = rng.integers(0, 400, 20_000)
    values = np.clip(rng.normal(quality[ratees], 0.2), 0, 1)
    names = [str(n) for n in range(400)]
    log = Log(np.arange(20_000) % 400, ratees, values, None, names, list(names))
    fitted = Shrinkage.fitted(log, quality)
    assert fitted.weight == pytest.approx(4.0, rel=0.15)  # 0.2^2 / 0.1^2
    assert fitted.mean == pytest.approx(quality.mean())
    one = Log(np.arange(3), np.arange(3), np.array([0.1, 0.5, 0.9]), None, names, names)
    assert Shrinkage.fitted(one, np.full(3, 0.5)).weight == 0
    same = one._replace(ratees=np.array([0, 0, 1]), values=np.full(3, 0.5))
    assert Shrinkage.fitted(same, np.full(2, 0.5)).weight == 0
    trust = rng.random(5)
    assert Shrinkage().of(trust, np.arange(5)).tolist() == trust.tolist()


def test_equal_later_means_are_equal_ranks() -> None:
    """Whatever sums of floats they come from."""
    rng = np.random.default_rng(0)
    columns = {
        "rater": rng.integers(0, 300, 3_000),
        "ratee": rng.integers(0, 120, 3_000),
        "rating": np.full(3_000, 7),
    }
    found = rate(columns, scale=(0, 10), model="mean").calibration
    assert found is not None
    assert (found.trust_forecast, found.estimate_forecast) == (0, 0)


def test_newcomers_count_for_the_mean_to_which_trust_is_drawn() -> None:
    log = community(0, 4_000, noise=1.0)
    new = np.arange(200)
    names = [*log.ratee_names, *(f"new{n}" for n in new)]
    more = log._replace(
        raters=np.append(log.raters, new),
        ratees=np.append(log.ratees, 300 + new),
        values=np.append(log.values, np.zeros(200)),
        times=np.append(log.times, np.full(200, log.times[-1])),
        ratee_names=names,
    )
    rated = rate(more, model="all-time-mean")
    calibration = rated.calibration
    assert calibration is not None
    assert calibration.mean == pytest.approx(rated.ratees.trust.mean())
    fitted = Shrinkage.fitted(more, rated.ratees.trust.to_numpy())
    assert calibration.weight in (0, pytest.approx(fitted.weight))
