"""Shares of the optimum and their interquartile means, checked by hand and against the formula."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roletrust_env.benchmarking.learners.results import (
    ALL_TASKS,
    LearnerRun,
    aggregate,
    make_scale,
    ranking,
)
from roletrust_env.metrics.confidence import interquartile_mean

FLOATS = st.floats(-2, 2, allow_nan=False)


@settings(max_examples=25)
@given(st.lists(FLOATS, min_size=2, max_size=12), st.lists(FLOATS, min_size=2, max_size=12))
def test_the_interquartile_mean_is_the_mean_of_the_middle_half(first, second):
    """The value is the mean of the sorted runs without a quarter (rounded down) at each end, and is
    in its interval."""
    runs = sorted(first + second)
    cut = len(runs) // 4
    result = interquartile_mean([np.array(first), np.array(second)])
    assert result.value == pytest.approx(np.mean(runs[cut : len(runs) - cut]), abs=1e-12)
    assert min(runs) - 1e-12 <= result.low <= result.high <= max(runs) + 1e-12


def test_each_task_is_resampled_separately():
    """Equal runs in each task have no spread, even if the tasks differ."""
    equal = interquartile_mean([np.full(5, 0.1), np.full(5, 0.9)])
    assert (equal.low, equal.high) == (equal.value, equal.value)
    assert interquartile_mean([np.array([0.1] * 5 + [0.9] * 5)]).low < 0.4


def test_the_interval_covers_the_middle_of_a_normal():
    draws = np.random.default_rng(0).normal(0.5, 0.1, (100, 2, 10))
    intervals = [interquartile_mean(list(runs)) for runs in draws]
    covered = np.mean([one.low <= 0.5 <= one.high for one in intervals])
    assert 0.85 < covered <= 0.99  # 20 runs are few for a bootstrap
    assert intervals[0] == interquartile_mean(list(draws[0]))


def test_missing_runs_have_no_interval():
    assert np.isnan(interquartile_mean([])).all()
    assert np.isnan(interquartile_mean([np.ones(3), np.ones(0)])).all()
    single = interquartile_mean([np.array([0.3])])
    assert single.value == pytest.approx(0.3)
    assert np.isnan([single.low, single.high]).all()


HONEST_RUNS = {
    "a": [LearnerRun("a", "honest play", 0, s, 0.1 * s) for s in (0, 1)],
    "b": [LearnerRun("b", "honest play", 0, 0, 0.2)],
}
RUNS = [
    LearnerRun("a", "PPO", 10, 0, 0.5),
    LearnerRun("a", "PPO", 10, 1, 0.5),
    LearnerRun("a", "SAC", 10, 0, 0.2),
    LearnerRun("a", "SAC", 20, 0, 0.3),
    LearnerRun("b", "SAC", 10, 0, 0.6),
    LearnerRun("b", "SAC", 20, 0, 0.4),
]


def test_a_share_lies_between_honest_play_in_the_same_games_and_the_top_score():
    known = make_scale(HONEST_RUNS["a"], {"exact": 1.05}, RUNS[:4])
    assert known.description == "the bound 'exact'"
    assert [known.share(run) for run in RUNS[:2]] == pytest.approx(
        [0.5, 0.4]
    )  # 0.05 is honest play in the mean
    best = make_scale(HONEST_RUNS["b"], {}, RUNS[4:])
    assert best.description == "the best that was found, by SAC with 10 rounds"
    assert best.share(RUNS[4]) == 1
    assert best.share(RUNS[5]) == pytest.approx(0.5)


def test_without_a_run_above_honest_play_there_is_no_share():
    flat = make_scale(HONEST_RUNS["b"], {}, [LearnerRun("b", "PPO", 10, 0, 0.2)])
    assert np.isnan(flat.share(RUNS[4]))


def test_a_learner_without_a_task_has_no_result_over_all_tasks():
    scales = {
        "a": make_scale(HONEST_RUNS["a"], {"exact": 1.05}, RUNS[:4]),
        "b": make_scale(HONEST_RUNS["b"], {}, RUNS[4:]),
    }
    results = aggregate(scales, RUNS)
    every = {(one.learner, one.budget): one for one in results if one.task == ALL_TASKS}
    assert list(every) == [("SAC", 10), ("SAC", 20)]
    assert every["SAC", 10].share.value == pytest.approx((0.2 + 1) / 2)
    assert np.isnan(every["SAC", 10].score)
    assert ranking(results) == ["SAC", "PPO"]
    ppo = next(one for one in results if one.learner == "PPO")
    assert (ppo.task, ppo.runs, ppo.score) == ("a", 2, 0.5)
