"""Iterative filtering against loops that go on until nothing moves, and by hand."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import exp, sqrt
from statistics import fmean

import numpy as np
import pytest
from model_cases import Matrix, Vector, assert_matches
from refusals import refuses

from roletrust_env.trust import Ratings, make_trust_model
from roletrust_env.trust.models.central import iterative_filtering

LAM, INITIAL = 0.7, 0.3
WEIGHTINGS: dict[str, Callable[[Vector], Vector]] = {
    "linear": lambda distances: [1 - d / (max(distances) + 0.5) for d in distances],
    "exponential": lambda distances: [exp(-2 * d) for d in distances],
    "power": lambda distances: [1 / sqrt(d + 0.05) for d in distances],
}
EACH = pytest.mark.parametrize("weighting", WEIGHTINGS)


def filtered(
    notes: list[dict[int, float]], weighting: str, steps: int
) -> tuple[dict[int, float], dict[int, float]]:
    """The weights of the raters as shares of the largest, and the worth of providers, of whom there
    are notes."""
    raters = [i for i, own in enumerate(notes) if own]
    providers = sorted({j for own in notes for j in own})
    weights = dict.fromkeys(raters, 1.0)
    worth: dict[int, float] = {}
    for step in range(steps + 1):
        if step:
            distances = [fmean((f - worth[j]) ** 2 for j, f in notes[i].items()) for i in raters]
            weights = dict(zip(raters, WEIGHTINGS[weighting](distances), strict=True))
        for j in providers:
            of = [i for i in raters if j in notes[i]]
            worth[j] = sum(weights[i] * notes[i][j] for i in of) / sum(weights[i] for i in of)
    return {i: weights[i] / max(weights.values()) for i in raters}, worth


def reference(
    rounds: Sequence[tuple[Matrix, Matrix]], peers: Matrix, weighting: str
) -> Iterator[tuple[Vector, Vector]]:
    raters, providers = range(len(peers)), range(len(peers[0]))
    notes: list[dict[int, float]] = [{} for _ in raters]
    for ratings, mask in rounds:
        for i in raters:
            for j in providers:
                if mask[i][j]:
                    notes[i][j] = LAM * ratings[i][j] + (1 - LAM) * notes[i].get(j, ratings[i][j])
        weights, worth = filtered(notes, weighting, iterative_filtering.STEPS)
        yield [weights.get(i, INITIAL) for i in raters], [worth.get(j, INITIAL) for j in providers]


@EACH
def test_the_model_matches_its_reference(weighting: str) -> None:
    model = make_trust_model("iterative-filtering", lam=LAM, initial=INITIAL, weighting=weighting)
    assert_matches(model, partial(reference, weighting=weighting))


@EACH
def test_the_steps_come_to_rest(weighting: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Twenty times as many change nothing by more than 1e-6, of honest raters and liars in any
    number."""
    rng, shape = np.random.default_rng(0), (5, 3, 200)
    honest = rng.normal(0.8, 0.1, shape).clip(0, 1)
    lies = np.arange(5)[:, None, None] < rng.integers(0, 5, 200)
    ratings, mask = np.where(lies, rng.random(shape[1:]), honest), rng.random(shape) < 0.8
    model = make_trust_model("iterative-filtering", weighting=weighting)
    found = model.update(model.start(ratings), Ratings(ratings, mask))
    monkeypatch.setattr(iterative_filtering, "STEPS", 20 * iterative_filtering.STEPS)
    longer = model.update(model.start(ratings), Ratings(ratings, mask))
    np.testing.assert_allclose(found.tor, longer.tor, rtol=0, atol=1e-6)
    np.testing.assert_allclose(found.top, longer.top, rtol=0, atol=1e-6)


@EACH
def test_two_who_disagree_stay_equals(weighting: str) -> None:
    model = make_trust_model("iterative-filtering", weighting=weighting)
    ratings = np.array([[0.0], [1.0]])
    state = model.update(model.start(ratings), Ratings(ratings, ratings >= 0))
    assert state.tor == pytest.approx([1, 1])
    assert state.top == pytest.approx([0.5])


def test_a_lone_liar_of_three_by_hand() -> None:
    """It rates 0, the others 1, and all agree on r: with "power", r = 2 u / (2 u + w).

    The honest weigh u = 1 / sqrt((1 - r)^2 + 0.05) and the liar w = 1 / sqrt(r^2 + 0.05); r =
    0.8762 solves it.
    """
    ratings = np.array([[0.0], [1.0], [1.0]])
    model = make_trust_model("iterative-filtering", weighting="power")
    state = model.update(model.start(ratings), Ratings(ratings, ratings >= 0))
    r = float(state.top[0])
    u, w = 1 / sqrt((1 - r) ** 2 + 0.05), 1 / sqrt(r**2 + 0.05)
    assert r == pytest.approx(2 * u / (2 * u + w), abs=1e-9)
    assert state.tor == pytest.approx([w / u, 1, 1], abs=1e-9)
    assert r == pytest.approx(0.8762, abs=1e-4)


def test_an_unknown_weighting_is_refused() -> None:
    with refuses(ValueError, "cubic", "linear", "exponential"):
        make_trust_model("iterative-filtering", weighting="cubic")
