"""What a judge hears, and judges taken some at a time."""

from typing import Any

import numpy as np
import pytest
import torch
from model_cases import play, random_rounds, read

from roletrust_env.trust import make_trust_model, personal
from roletrust_env.trust.personal import Evidence, product, published_raters, weighted_advice


@pytest.mark.parametrize("batch", [(), (5,), (2, 3)])
@pytest.mark.parametrize("asarray", [np.asarray, torch.asarray])
def test_the_product_is_that_of_every_game(batch: tuple[int, ...], asarray: Any) -> None:
    rng = np.random.default_rng(0)
    one, other = rng.random((3, 4, *batch)), rng.random((4, 2, *batch))
    wanted = np.einsum("ab...,bc...->ac...", one, other)
    np.testing.assert_allclose(
        np.asarray(product(asarray(one), asarray(other))), wanted, rtol=1e-12
    )


def test_a_judge_hears_whom_it_believes() -> None:
    credence, sums = (
        np.array([[1.0, 0.5], [0.0, 1.0]]),
        np.array([[2.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    )
    said = Evidence(np.array([[2.0, 0.0, 1.0], [2.0, 0.0, 1.0]]), sums)
    mean, weight = weighted_advice(credence, said, said)
    assert mean == pytest.approx(np.array([[2 / 3, 0, 0.5 / 1.5], [0, 0, 1]]))
    assert weight.tolist() == [[3, 0, 1.5], [2, 0, 1]]
    mean, weight = weighted_advice(credence, said, Evidence(2 * said.counts, 0 * sums))
    assert mean == pytest.approx(np.array([[0, 0, 0.5 / 2.5], [0, 0, 0]]))
    assert weight.tolist() == [[5, 0, 2.5], [4, 0, 2]]


def test_nobody_publishes_what_it_thinks_of_itself() -> None:
    credence = np.array([[0.9, 0.2, 0.4], [0.6, 0.9, 0.8], [0.2, 0.4, 0.9]])
    assert published_raters(credence) == pytest.approx([0.4, 0.3, 0.6])
    assert published_raters(np.array([[0.3]])) == 1


@pytest.mark.parametrize("name", ["peer-trust", "clustering", "zhang-cohen", "regression-aligned"])
@pytest.mark.parametrize("block", [1, 60])  # one judge at a time; two, and one in the end
def test_judge_by_judge_is_all_at_once(
    name: str, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, rounds, like = make_trust_model(name), random_rounds((7, 4), 15), np.zeros((7, 4))
    together = read(model, play(model, rounds, like))
    monkeypatch.setattr(personal, "_BLOCK", block)
    for one, other in zip(read(model, play(model, rounds, like)), together, strict=True):
        assert np.array_equal(one, other)
