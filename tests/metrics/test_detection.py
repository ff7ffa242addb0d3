"""Detection, worked out by hand, and against SciPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses
from scipy.stats import mannwhitneyu

from roletrust_env.metrics import auc, classify, false_alarms, rounds_to_detection

NAN = np.nan


def test_auc_counts_pairs() -> None:
    trust = np.array([0.9, 0.5, 0.3, 0.5])[:, None]
    assert auc(trust, [2, 3]).value == pytest.approx((1 + 1 + 1 + 0.5) / 4)
    assert auc(trust, [0]).value == 0
    undefined = auc(trust, [])
    assert np.isnan(undefined.value).all()
    assert "no attackers" in undefined.why


@given(st.lists(st.integers(0, 4), min_size=2, max_size=9), st.integers(1, 8))
def test_auc_is_the_statistic_of_mann_and_whitney(notes: list[int], bad: int) -> None:
    trust, bad = np.array(notes, float), min(bad, len(notes) - 1)
    expected = mannwhitneyu(trust[bad:], trust[:bad]).statistic / bad / (len(notes) - bad)
    assert auc(trust, range(bad)).value == pytest.approx(expected)


def test_a_threshold_sorts() -> None:
    trust = np.array([0.9, 0.4, 0.6, 0.2, 0.7, NAN])  # attackers: 3, 4 and 5, who is gone
    found = classify(trust, [3, 4, 5])
    assert found.precision.value == pytest.approx(1 / 2)
    assert found.recall.value == pytest.approx(1 / 2)
    assert found.false_alarms.value == pytest.approx(1 / 3)
    assert found.mcc.value == pytest.approx((1 * 2 - 1 * 1) / np.sqrt(2 * 2 * 3 * 3))


def test_what_nobody_is_sorted_by_is_undefined() -> None:
    found = classify(np.array([0.9, 0.8]), [])
    assert found.false_alarms.value == 0
    assert np.isnan([found.mcc.value, found.precision.value, found.recall.value]).all()
    assert found.recall.why == "there are no attackers"


def test_attackers_are_told_apart_once_all_honest_agents_are_above_them() -> None:
    trust = np.array([[0.5, 0.5, 0.5], [0.6, 0.5, 0.55], [0.7, 0.6, 0.3], [0.7, 0.6, 0.2]])[
        :, :, None
    ]
    assert rounds_to_detection(trust, [2]).value == 2
    assert rounds_to_detection(trust, [2], start=1).value == 1
    assert rounds_to_detection(trust, [2], alarms=0.5).value == 1
    never = rounds_to_detection(trust[:2], [2])
    assert np.isnan(never.value).all()
    assert "never" in never.why
    assert np.isnan(
        rounds_to_detection(np.array([[0.9, NAN], [0.9, NAN]])[:, :, None], [1]).value
    ).all()  # not there
    with refuses(ValueError, "start", "9"):
        rounds_to_detection(trust, [2], start=9)


def test_false_alarms_are_counted_where_the_honest_are() -> None:
    trust = np.array([[0.9, 0.4], [0.3, NAN]])[:, :, None]
    assert false_alarms(trust, [0, 1]).value == pytest.approx(2 / 3)
    assert np.isnan(false_alarms(trust, []).value).all()


def test_who_is_at_the_threshold_is_not_under_it() -> None:
    trust = np.array([0.5, 0.25])  # the second attacks
    assert classify(trust, [1]).false_alarms.value == 0
    assert classify(trust, [0]).recall.value == 0
    assert false_alarms(trust[None], [0, 1]).value == 0.5
