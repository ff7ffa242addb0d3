"""Means of perceptions and ranks, against slow copies."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from roletrust_baselines.coalition import Estimates, ranks
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random

VALUES = st.lists(
    st.sampled_from([0.0, 0.2, 0.5, 0.7, 1.0]) | st.floats(0, 1).map(lambda x: round(x, 3)),
    min_size=1,
)


def slow_ranks(values, left_out=()):
    ranked = [j for j in range(len(values)) if j not in left_out]
    found = [1.0] * len(values)
    for j in ranked:
        better = sum(values[k] > values[j] for k in ranked)
        equal = sum(values[k] == values[j] for k in ranked) - 1
        found[j] = (better + equal / 2) / max(len(ranked) - 1, 1)
    return found


@given(values=VALUES, data=st.data())
def test_ranks_count_the_better_ones_and_half_of_the_equal_ones(values, data):
    left_out = data.draw(st.sets(st.integers(0, len(values) - 1), max_size=len(values) - 1))
    mask = np.array([j in left_out for j in range(len(values))]) if left_out else None
    assert ranks(np.array(values), mask) == pytest.approx(slow_ranks(values, left_out))


@given(values=VALUES, seed=st.integers(0, 99))
def test_ranks_follow_their_providers(values, seed):
    array, order = np.array(values), np.random.default_rng(seed).permutation(len(values))
    assert ranks(array[order]) == pytest.approx(ranks(array)[order])
    assert ranks(torch.tensor(values, dtype=torch.float64)).tolist() == pytest.approx(
        ranks(array).tolist()
    )


def test_rounding_does_not_order_equal_providers():
    assert ranks(np.array([0.3, 0.1 + 0.2, 0.9])).tolist() == [0.75, 0.75, 0]
    assert ranks(np.array([0.3, 0.1 + 0.2, 0.9], np.float32)).dtype == np.float32


@given(seed=st.integers(0, 10_000))
def test_estimates_are_means_of_what_was_perceived(seed):
    rng, shape = np.random.default_rng(seed), (4, 2, 3)  # providers, raters, games
    memory = Estimates.nothing(Random(rng), shape[1:])
    views = []
    for _ in range(3):
        awaiting = rng.random(shape) < 0.4
        service, published = rng.random(shape) * awaiting, rng.random(shape)
        views.append(
            RaterView(np.zeros(()), np.zeros(()), published, service, awaiting, service, awaiting)
        )
        memory = memory.after(views[-1])
    means = memory.means(views[-1].published)
    for place in np.ndindex(shape):
        seen = [view.service[place] for view in views if view.awaiting[place]]
        assert means[place] == pytest.approx(np.mean(seen) if seen else views[-1].published[place])
