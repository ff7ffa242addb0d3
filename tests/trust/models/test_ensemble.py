"""The mean of first-hand trust and HABIT."""

from collections.abc import Iterator

import numpy as np
from judged import DELIVERED, RECEIVED, Published, assert_gradients_are_finite, judge_trust
from model_cases import Rounds, assert_matches

from roletrust_env.trust import Ratings, make_trust_model

PARTS = "first-hand", "habit"


def slow(rounds: Rounds, peers: list[list[float]]) -> Iterator[Published]:
    """The two models side by side, each of which has a slow reference of its own."""
    models = [make_trust_model(name) for name in PARTS]
    states = [model.start(np.zeros((len(peers), len(peers[0])))) for model in models]
    for f, m in rounds:
        ratings = Ratings(np.asarray(f), np.asarray(m, bool))
        states = [model.update(state, ratings) for model, state in zip(models, states, strict=True)]
        tops = [
            model.provider_trust(state).tolist()
            for model, state in zip(models, states, strict=True)
        ]
        yield Published(
            models[0].rater_trust(states[0]).tolist(),
            [(a + b) / 2 for a, b in zip(*tops, strict=True)],
        )


def test_it_is_the_mean_of_both() -> None:
    assert_matches(make_trust_model("ensemble"), slow)


def test_each_judge_has_the_mean_of_its_trust() -> None:
    both, *parts = (
        judge_trust(make_trust_model(name), DELIVERED, RECEIVED) for name in ("ensemble", *PARTS)
    )
    np.testing.assert_allclose(both, (parts[0] + parts[1]) / 2, rtol=0, atol=1e-15)
    assert abs(parts[0] - parts[1]).max() > 0.05


def test_gradients_are_finite() -> None:
    assert_gradients_are_finite(make_trust_model("ensemble"))
