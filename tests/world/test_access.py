"""Who is served by whom."""

from collections.abc import Callable

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from hypothesis import given

from roletrust_env.world import Choice
from roletrust_env.world.access import choose_providers, in_range

NAMESPACES = pytest.mark.parametrize("asarray", [np.asarray, torch.asarray], ids=["numpy", "torch"])


@NAMESPACES
def test_in_range(asarray: Callable) -> None:
    raters, providers = (
        asarray([[0.0, 0.0], [9.0, 9.0]]),
        asarray([[3.0, 4.0], [0.0, 5.01], [9.0, 9.0]]),
    )
    near = np.asarray(in_range(raters, providers, 5.0))
    assert near.tolist() == [[True, False, False], [False, False, True]]
    batched = in_range(
        raters[..., None] + asarray([0.0, 1.0]), providers[..., None] + asarray([0.0, 1.0]), 5.0
    )
    assert np.array_equal(np.asarray(batched), np.stack([near, near], -1))


@given(
    st.integers(1, 4),
    st.integers(1, 5),
    st.sampled_from([0.0, 0.1]),
    st.integers(0, 999),
    st.data(),
)
def test_as_many_as_wanted_of_those_available(
    s: int, p: int, temperature: float, seed: int, data
) -> None:
    k, rng = data.draw(st.integers(1, p)), np.random.default_rng(seed)
    batch = data.draw(st.sampled_from([(), (3,), (2, 2)]))
    top, luck = rng.choice([0.0, 0.3, 1.0], (p, *batch)), rng.random((s, p, *batch))
    available = rng.random((s, p, *batch)) < 0.6
    chosen = choose_providers(Choice(providers=k, temperature=temperature), top, available, luck)
    assert not (chosen & ~available).any()
    assert np.array_equal(chosen.sum(axis=1), np.minimum(k, available.sum(axis=1)))
    if temperature == 0:
        left = available & ~chosen
        worst = np.where(chosen, top[None], np.inf).min(axis=1)
        assert np.all(np.where(left, top[None], -np.inf).max(axis=1) <= worst)
    tensors = choose_providers(
        Choice(providers=k, temperature=temperature), *map(torch.asarray, (top, available, luck))
    )
    assert np.array_equal(tensors.numpy(), chosen)


def test_who_explores_chooses_at_random_and_others_by_their_own_trust() -> None:
    random, n = np.random.default_rng(0), 60_000
    luck, explore = random.random((n, 3)), random.random(n)
    trust = np.array([[0.2, 0.9, 0.1], [0.9, 0.2, 0.1]])[np.arange(n) % 2]
    available = np.ones(luck.shape, bool)
    available[:, 2] = np.arange(n) % 3 > 0
    chosen = choose_providers(Choice(by="own", explore=0.3), trust, available, luck, explore)
    assert (chosen.sum(axis=1) == 1).all()
    explores = explore < 0.3
    assert (chosen[~explores].argmax(axis=1) == trust[~explores].argmax(axis=1)).all()
    free = explores & available[:, 2]
    assert chosen[free].mean(axis=0) == pytest.approx([1 / 3] * 3, abs=0.015)
    assert chosen[explores & ~free].mean(axis=0) == pytest.approx([0.5, 0.5, 0], abs=0.015)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_greedy_ties_are_broken_evenly(dtype: type) -> None:
    luck = np.random.default_rng(0).random((30_000, 3), dtype=dtype)
    top = np.array([1.0, 1.0, 0.2], dtype=dtype)
    shares = choose_providers(Choice(), top, np.ones(luck.shape, bool), luck).mean(axis=0)
    assert shares == pytest.approx([0.5, 0.5, 0], abs=0.01)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_greed_sees_small_differences(dtype: type) -> None:
    luck = np.random.default_rng(0).random((1000, 2), dtype=dtype)
    top = np.array([0.5, 0.50002], dtype=dtype)
    assert choose_providers(Choice(), top, np.ones(luck.shape, bool), luck)[:, 1].all()


def test_softmax_has_the_shares_of_a_softmax() -> None:
    top, luck = np.array([0.2, 0.5, 0.9]), np.random.default_rng(0).random((100_000, 3))
    everyone = np.ones(luck.shape, bool)
    weight = np.exp(top / 0.4)
    share = weight / weight.sum()
    assert choose_providers(Choice(temperature=0.4), top, everyone, luck).mean(
        axis=0
    ) == pytest.approx(share, abs=0.006)
    # Two without replacement: the second among the others, by the same weights.
    second = [
        share[j]
        + sum(share[i] * weight[j] / (weight.sum() - weight[i]) for i in range(3) if i != j)
        for j in range(3)
    ]
    two = choose_providers(Choice(providers=2, temperature=0.4), top, everyone, luck).mean(axis=0)
    assert two == pytest.approx(second, abs=0.006)


@pytest.mark.parametrize("temperature", [1e-6, 1e6])
def test_extreme_temperatures_choose_all_the_same(temperature: float) -> None:
    top, luck = np.array([0.0, 0.5, 1.0]), np.random.default_rng(0).random((100, 3))
    chosen = choose_providers(
        Choice(providers=2, temperature=temperature), top, np.ones(luck.shape, bool), luck
    )
    assert np.all(chosen.sum(axis=1) == 2)
    if temperature <= 1e-6:
        assert chosen[:, 2].all()
