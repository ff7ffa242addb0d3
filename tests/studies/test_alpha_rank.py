"""Alpha-rank, against a chain that is followed step by step, and games whose answer is plain."""

from math import exp

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from studies.equilibrium import alpha_rank

pytestmark = pytest.mark.slow


def takes_over(gain: float) -> float:
    return 1 / 50 if gain == 0 else (1 - exp(-gain)) / (1 - exp(-50 * gain))


def followed(scores: np.ndarray, intensity: float) -> list[float]:
    """The same by following the chain for a long time from every state alike."""
    m, a = scores.shape
    states = [(i, j) for i in range(m) for j in range(a)]
    chain = np.zeros((m * a, m * a))
    for s, (i, j) in enumerate(states):
        for t, (k, n) in enumerate(states):
            if (i == k) != (j == n):
                gain = scores[k, n] - scores[i, j] if j == n else scores[i, j] - scores[k, n]
                chain[s, t] = takes_over(intensity * gain) / (m + a - 2)
        chain[s, s] = 1 - chain[s].sum()
    found = np.full(m * a, 1 / (m * a)) @ np.linalg.matrix_power(chain, 100_000)
    return found.reshape(m, a).sum(axis=1).tolist()


@settings(max_examples=30, deadline=None)
@given(scores=arrays(np.float64, (3, 2), elements=st.sampled_from([0.0, 0.1, 0.2, 0.5])))
def test_it_is_where_the_chain_ends(scores: np.ndarray) -> None:
    assert alpha_rank(scores, intensity=2) == pytest.approx(followed(scores, 2), abs=1e-6)


def test_a_model_that_is_always_better_is_all_that_remains() -> None:
    scores = np.array([[0.9, 0.8, 0.7], [0.4, 0.5, 0.3]])
    assert alpha_rank(scores) == pytest.approx([1, 0], abs=1e-6)


def test_equal_models_share_alike() -> None:
    assert alpha_rank(np.zeros((4, 3))) == pytest.approx([0.25] * 4)
    assert alpha_rank(np.array([[0.1]])) == pytest.approx([1])
    assert alpha_rank(np.array([[0.1, 0.5]])) == pytest.approx([1])
    assert alpha_rank(np.array([[3.0, -3.0], [-3.0, 3.0]]), intensity=1000) == pytest.approx([0.5, 0.5])
