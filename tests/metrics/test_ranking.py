"""Rank accuracy against SciPy, and worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses
from scipy import stats

from roletrust_env.metrics import absolute_error, coverage, kendall_tau, spearman

NOTES = st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=2, max_size=9)


@given(NOTES)
def test_ranks_correlate_as_in_scipy(notes: list[tuple[int, int]]) -> None:
    trust, quality = np.array(notes, float).T / 4
    expected = stats.kendalltau(trust, quality).statistic
    assert kendall_tau(trust, quality).value == pytest.approx(expected, nan_ok=True)
    if len(set(trust)) > 1 and len(set(quality)) > 1:
        assert spearman(trust, quality).value == pytest.approx(
            stats.spearmanr(trust, quality).statistic
        )
    else:
        assert np.isnan(spearman(trust, quality).value)


def test_tau_a_divides_by_all_pairs() -> None:
    trust, quality = np.array([0.1, 0.5, 0.5]), np.array([0.2, 0.3, 0.9])
    assert kendall_tau(trust, quality, "a").value == pytest.approx(2 / 3)
    assert kendall_tau(trust, quality, "b").value == pytest.approx(2 / np.sqrt(2 * 3))
    with refuses(ValueError, "a", "b"):
        kendall_tau(trust, quality, "c")  # type: ignore[arg-type]


def test_a_provider_without_trust_is_left_out() -> None:
    trust, quality = np.array([0.1, np.nan, 0.5]), np.array([0.9, 0.3, 0.2])
    assert kendall_tau(trust, quality).value == spearman(trust, quality).value == -1
    assert absolute_error(trust, quality).value == pytest.approx((0.8 + 0.3) / 2)
    assert kendall_tau(trust[:2], quality[:2]).why != ""
    assert kendall_tau(quality, trust).value == spearman(quality, trust).value == -1
    assert kendall_tau(quality, trust, "a").value == -1


def test_every_game_of_a_batch_has_its_own_number() -> None:
    rng = np.random.default_rng(0)
    trust, quality = rng.random((6, 5)), rng.random((6, 5))
    for metric in (kendall_tau, spearman, absolute_error):
        each = [metric(trust[:, k], quality[:, k]).value for k in range(5)]
        assert metric(trust, quality).value == pytest.approx(np.array(each))


def test_coverage_counts_providers_of_whom_there_is_a_rating() -> None:
    rated = np.zeros((3, 2, 4, 1), bool)
    rated[0, 1, 2] = rated[2, 0, 2] = rated[1, 0, 0] = True
    assert coverage(rated).value == 0.5
