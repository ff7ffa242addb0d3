"""Beta reputation against a slow reference and by hand."""

from functools import partial

import numpy as np
import pytest
from model_cases import assert_matches

from roletrust_env.trust import Ratings, make_trust_model


def slow(rounds, peers, keep=0.9, initial=0.5):
    raters, providers = range(len(peers)), range(len(peers[0]))
    good, bad, found = [0.0 for _ in providers], [0.0 for _ in providers], []
    for ratings, mask in rounds:
        for j in providers:
            notes = [ratings[i][j] for i in raters if mask[i][j]]
            if notes:
                good[j] = keep * good[j] + sum(notes)
                bad[j] = keep * bad[j] + sum(1 - f for f in notes)
        found.append(
            (
                [1.0 for _ in raters],
                [(good[j] + 2 * initial) / (good[j] + bad[j] + 2) for j in providers],
            )
        )
    return found


@pytest.mark.parametrize("parameters", [{}, {"keep": 0.5, "initial": 0.2}])
def test_it_is_the_formula(parameters) -> None:
    assert_matches(make_trust_model("beta", **parameters), partial(slow, **parameters))


def test_two_rounds_by_hand() -> None:
    """Notes 1 and 0.5, then 0: r = 1.5, s = 0.5, and then r = 0.9 * 1.5 = 1.35, s = 0.9 * 0.5 + 1 =
    1.45."""
    model = make_trust_model("beta")
    state = model.update(model.start(np.zeros((2, 1))), Ratings(np.array([[1.0], [0.5]])))
    assert model.provider_trust(state) == pytest.approx([2.5 / 4])
    state = model.update(state, Ratings(np.array([[0.0], [0.7]]), np.array([[True], [False]])))
    assert model.provider_trust(state) == pytest.approx([2.35 / 4.8])


@pytest.mark.parametrize("levels", [2, 5, 10])
def test_it_is_the_point_estimate_of_dirichlet_reputation_of_ratings_on_levels(levels: int) -> None:
    rng, values, keep, evidence = (
        np.random.default_rng(0),
        np.linspace(0, 1, levels),
        0.9,
        np.zeros((levels, 3)),
    )
    model = make_trust_model("beta", keep=keep)
    state = model.start(np.zeros((4, 3)))
    for _ in range(5):
        places = rng.integers(levels, size=(4, 3))
        state = model.update(state, Ratings(values[places]))
        evidence = keep * evidence + (places[None] == np.arange(levels)[:, None, None]).sum(axis=1)
        scores = (evidence + 2 / levels) / (2 + evidence.sum(axis=0))
        np.testing.assert_allclose(model.provider_trust(state), values @ scores, rtol=0, atol=1e-12)
