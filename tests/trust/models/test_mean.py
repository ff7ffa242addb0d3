"""The mean, worked by hand."""

import numpy as np
import pytest

from roletrust_env.trust import make_trust_model


def test_mean_is_an_exponential_mean_of_the_average_rating() -> None:
    model = make_trust_model("mean", lam=0.75, initial=0.2)
    assert not model.rates_raters
    state = model.start(np.zeros((3, 2)))
    ratings = np.array([[1.0, 0.9], [0.5, 0.8], [0.0, 0.7]])
    mask = np.array([[True, False], [True, False], [False, False]])
    state = model.update(state, ratings, mask)
    assert model.provider_trust(state) == pytest.approx([0.75 * 0.75 + 0.25 * 0.2, 0.2])
    state = model.update(state, ratings, ~mask)
    assert model.provider_trust(state) == pytest.approx([0.25 * (0.75 * 0.75 + 0.25 * 0.2), 0.75 * 0.8 + 0.05])
    assert np.array_equal(model.rater_trust(state), np.ones(3))
