"""What the personal models share."""

import numpy as np
import pytest

from roletrust_env.trust import PROVIDER, Ratings, personal


def test_judges_in_blocks_are_judges_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    credence, said = rng.random((7, 7, 2)), rng.random((7, 3, 2))
    at_once = personal.product(credence, said)
    np.testing.assert_allclose(
        at_once, np.einsum("ike,kje->ije", credence, said), rtol=0, atol=1e-12
    )
    seen = []
    monkeypatch.setattr(personal, "_BLOCK", 2 * said.size)

    def of(some: slice) -> np.ndarray:
        seen.append(some)
        return at_once[some]

    assert np.array_equal(personal.by_judges(of, said), at_once)
    assert seen == [slice(0, 2), slice(2, 4), slice(4, 6), slice(6, 8)]
    assert np.array_equal(personal.product(credence, said), at_once)


def test_what_opinions_were_worth_is_summed_over_what_both_rated() -> None:
    f, m = (
        np.array([[1.0, 0.5, 9], [0.25, 0.5, 0.75]]),
        np.array([[True, True, False], [True, True, True]]),
    )
    ratings = Ratings(f, m)
    assert personal.compare_opinions(ratings, lambda apart: 1 - apart).tolist() == [
        [0, 1.25],
        [1.25, 0],
    ]
    assert personal.in_common(ratings).tolist() == [[0, 2], [2, 0]]
    assert ratings.rated(PROVIDER).tolist() == [True, True, True]


@pytest.mark.parametrize("rows", [1, 2, 9])
def test_opinions_in_blocks_are_opinions_at_once_and_a_full_round_needs_no_flags(
    rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    f = np.random.default_rng(0).random((7, 3, 2))
    monkeypatch.setattr(personal, "_BLOCK", rows * f.size)
    for ratings in (Ratings(f), Ratings(f, np.ones(f.shape, bool)), Ratings(f, f > 0.3)):
        met = ratings.weights
        apart = abs(ratings.values[:, None] - ratings.values[None])
        other = personal.others(f)
        wanted = other * (met[:, None] * met[None] * (1 - apart)).sum(axis=2)
        assert np.array_equal(personal.compare_opinions(ratings, lambda apart: 1 - apart), wanted)
        common = other * (met[:, None] * met[None]).sum(axis=2)
        assert np.array_equal(personal.in_common(ratings), common)


def test_a_memory_keeps_the_last_ratings_of_each_pair() -> None:
    memory = personal.nothing_yet(np.ones((1, 2)), 2)
    for f, m in (([1.0, 2.0], [1, 1]), ([3.0, 9.0], [1, 0]), ([4.0, 5.0], [1, 1])):
        memory = personal.push(memory, np.array([f]), Ratings(np.array([f]), np.array([m], bool)))
    assert memory.tolist() == [[[4, 5]], [[3, 2]]]


def test_a_mean_absorbs_values_and_is_exact_where_there_are_none() -> None:
    before = np.array([0.1, 0.1, 0.3])
    weight, sums, count = (
        np.array([2.0, 2.0, 0.0]),
        np.array([1.5, 0.0, 0.7]),
        np.array([2.0, 0.0, 1.0]),
    )
    assert personal.absorb(before, weight, sums, count) == pytest.approx([1.7 / 4, 0.1, 0.7])
    assert personal.absorb(before, weight, sums, count)[1] == 0.1


def test_what_is_published_is_the_judges_mean_and_nobody_judges_itself() -> None:
    credence = np.array([[9.0, 0.2, 0.4], [0.6, 9.0, 0.8], [0.0, 0.4, 9.0]])
    assert personal.published_raters(credence) == pytest.approx([0.3, 0.3, 0.6])
    assert personal.published_raters(np.array([[0.3]])).tolist() == [1]
    assert personal.published_providers(
        np.array([[0.2, 1.0], [0.4, 1 + 1e-15]])
    ).tolist() == pytest.approx([0.3, 1])
    assert personal.published_providers(np.array([[1 + 1e-15]])).max() == 1
