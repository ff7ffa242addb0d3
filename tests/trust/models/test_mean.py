"""The mean against loops, and worked by hand."""

from collections.abc import Iterator, Sequence
from statistics import fmean

import numpy as np
import pytest
from model_cases import Matrix, Vector, assert_matches, named

from roletrust_env.trust import Ratings, make_trust_model

LAM, INITIAL = 0.7, 0.3  # of `named`


def reference(
    rounds: Sequence[tuple[Matrix, Matrix]], peers: Matrix
) -> Iterator[tuple[Vector, Vector]]:
    raters, top = range(len(peers)), [INITIAL for _ in peers[0]]
    for ratings, mask in rounds:
        for j, trust in enumerate(top):
            if notes := [ratings[i][j] for i in raters if mask[i][j]]:
                top[j] = LAM * fmean(notes) + (1 - LAM) * trust
        yield [1.0 for _ in raters], list(top)


def test_the_model_matches_its_reference() -> None:
    assert_matches(named("mean"), reference)


def test_mean_is_an_exponential_mean_of_the_average_rating() -> None:
    model = make_trust_model("mean", lam=0.75, initial=0.2)
    assert not model.rates_raters
    state = model.start(np.zeros((3, 2)))
    ratings = np.array([[1.0, 0.9], [0.5, 0.8], [0.0, 0.7]])
    mask = np.array([[True, False], [True, False], [False, False]])
    state = model.update(state, Ratings(ratings, mask))
    assert model.provider_trust(state) == pytest.approx([0.75 * 0.75 + 0.25 * 0.2, 0.2])
    state = model.update(state, Ratings(ratings, ~mask))
    assert model.provider_trust(state) == pytest.approx(
        [0.25 * (0.75 * 0.75 + 0.25 * 0.2), 0.75 * 0.8 + 0.05]
    )
    assert np.array_equal(model.rater_trust(state), np.ones(3))
