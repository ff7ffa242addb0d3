"""Measures with weights, and intervals that resample whole groups."""

import numpy as np
import pytest

from roletrust_env.metrics.resampling import auc, correlation, interval, mean, ranks


@pytest.mark.parametrize("seed", range(5))
def test_auc_counts_pairs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    score, bad = rng.integers(0, 5, 40) / 4, rng.integers(0, 2, 40) * 1.0
    weights = rng.integers(0, 3, 40) * 1.0
    won = pairs = 0.0
    for i in np.flatnonzero(bad):
        for j in np.flatnonzero(1 - bad):
            pairs += weights[i] * weights[j]
            won += weights[i] * weights[j] * ((score[i] < score[j]) + (score[i] == score[j]) / 2)
    assert auc(score, bad)(weights) == pytest.approx(won / pairs)
    assert np.isnan(auc(score, 0 * bad)(weights))


def test_an_interval_of_whole_groups_is_wider() -> None:
    rng = np.random.default_rng(0)
    groups = np.repeat(np.arange(20), 30)
    values = rng.normal(0, 1, 20)[groups] + rng.normal(0, 0.1, 600)
    whole, single = interval(mean(values), groups), interval(mean(values), np.arange(600))
    assert whole.value == single.value == pytest.approx(values.mean())
    assert whole.low < single.low < values.mean() < single.high < whole.high
    assert whole.high - whole.low == pytest.approx(2 * 1.96 * values.std() / np.sqrt(20), rel=0.3)
    assert np.isnan(interval(mean(values), 0 * groups).low)


def test_correlations_and_ranks() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.random(30), rng.random(30)
    twice = rng.integers(0, 3, 30)
    expected = np.corrcoef(np.repeat(x, twice), np.repeat(y, twice))[0, 1]
    assert correlation(x, y)(twice.astype(float)) == pytest.approx(expected)
    assert np.isnan(correlation(x, 0 * y)(np.ones(30)))
    assert ranks(np.array([0.3, 0.1, 0.3, 0.9])).tolist() == [0.5, 0.125, 0.5, 0.875]
