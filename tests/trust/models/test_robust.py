"""Median, trimmed and Huber mean against loops, against other libraries, and what theory says of
liars."""

from collections.abc import Callable, Iterator, Sequence
from statistics import fmean, median
from typing import Any

import numpy as np
import pytest
import scipy
from model_cases import Matrix, Vector, assert_matches, named

from roletrust_env.trust import Ratings, make_trust_model
from roletrust_env.trust.models.central.means import STEPS

LAM, INITIAL = 0.7, 0.3  # of `named`


def by_centre(centre: Callable[[Vector], float]) -> Callable[..., Iterator[tuple[Vector, Vector]]]:
    """The reference of a model that takes such a centre of the ratings of a provider."""

    def reference(
        rounds: Sequence[tuple[Matrix, Matrix]], peers: Matrix
    ) -> Iterator[tuple[Vector, Vector]]:
        raters, providers = range(len(peers)), range(len(peers[0]))
        tor, top = [INITIAL for _ in raters], [INITIAL for _ in providers]
        for ratings, mask in rounds:
            centres = {}
            for j in providers:
                if notes := [ratings[i][j] for i in raters if mask[i][j]]:
                    centres[j] = centre(notes)
                    top[j] = LAM * centres[j] + (1 - LAM) * top[j]
            for i in raters:
                if distances := [abs(ratings[i][j] - centres[j]) for j in providers if mask[i][j]]:
                    tor[i] = LAM * (1 - fmean(distances)) + (1 - LAM) * tor[i]
            yield list(tor), list(top)

    return reference


def trimmed(notes: Vector, share: float = 0.25) -> float:
    """Cut from each end, a little at a time, until the share is gone."""
    counts = dict.fromkeys(range(len(notes)), 1.0)
    order = sorted(counts, key=lambda i: notes[i])
    for ends in (order, order[::-1]):
        left = share * len(notes)
        for i in ends:
            cut = min(left, counts[i])
            counts[i], left = counts[i] - cut, left - cut
    return sum(counts[i] * notes[i] for i in counts) / sum(counts.values())


def huber(notes: Vector, width: float = 0.1) -> float:
    centre = median(notes)
    for _ in range(STEPS):
        weights = [1.0 if abs(f - centre) <= width else width / abs(f - centre) for f in notes]
        centre = sum(w * f for w, f in zip(weights, notes, strict=True)) / sum(weights)
    return centre


CENTRES = {"median": median, "trimmed-mean": trimmed, "huber-mean": huber}


@pytest.mark.parametrize("name", CENTRES)
def test_models_match_their_references(name: str) -> None:
    assert_matches(named(name), by_centre(CENTRES[name]))


def centre(model: Any, notes: Vector) -> float:
    """Of the ratings of one provider."""
    return float(model.centre(Ratings(np.array(notes)[:, None]))[0])


@pytest.mark.parametrize("seed", range(20))
def test_centres_match_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    notes = rng.random(10).tolist()
    trim = make_trust_model("trimmed-mean", share=0.3)
    assert centre(trim, notes) == pytest.approx(scipy.stats.trim_mean(notes, 0.3), abs=1e-12)
    assert centre(make_trust_model("median"), notes) == pytest.approx(np.median(notes), abs=1e-12)


def left_to_go(notes: Vector, width: float) -> float:
    """How far the Huber mean is from its fixed point, where the pulls of all ratings, clipped, are
    in balance."""
    found = centre(make_trust_model("huber-mean", width=width), notes)
    pull = lambda c: np.clip(np.array(notes) - c, -width, width).sum()  # noqa: E731
    side = np.sign(pull(found)) if abs(pull(found)) > 1e-12 else 0
    if side == 0:  # of an interval in balance, any point will do
        return 0.0
    ends = (found, 1) if side > 0 else (0, found)
    return abs(found - scipy.optimize.brentq(lambda c: pull(c) - side * 1e-13, *ends, xtol=1e-14))


@pytest.mark.parametrize(("width", "above"), [(0.02, 0), (0.1, 1e-6), (0.2, 1e-6), (0.3, 0)])
def test_how_near_the_steps_of_the_huber_mean_come(width: float, above: float) -> None:
    """To 5e-5 with 15 ratings, as it says; 1e-6 would be too much to say."""
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(600):
        liars, count = rng.integers(0, 8), rng.integers(2, 16)
        lies = np.full(min(liars, count), rng.random())
        worst = max(worst, left_to_go([*lies, *rng.random(count - len(lies))], width))
    assert above <= worst < 5e-5


def test_the_huber_mean_is_far_from_its_fixed_point_between_two_large_camps() -> None:
    assert 5e-2 < left_to_go([0.02] * 48 + [0.4, 0.42] + [0.9] * 49, 0.3) < 7e-2


def steady(name: str, liars: int, **parameters: float) -> tuple[np.ndarray, np.ndarray]:
    """Both trusts in the end, where of five raters of one good provider so many rate it 0."""
    model = make_trust_model(name, **parameters)
    ratings = np.array([[0.0]] * liars + [[1.0]] * (5 - liars))
    state = model.start(ratings)
    for _ in range(60):
        state = model.update(state, Ratings(ratings))
    return model.rater_trust(state), model.provider_trust(state)


def test_the_median_holds_at_two_liars_of_five_and_falls_at_three() -> None:
    for liars, left in ((2, 1.0), (3, 0.0)):
        raters, providers = steady("median", liars)
        assert providers == pytest.approx([left])
        assert raters == pytest.approx([1 - left] * liars + [left] * (5 - liars))


def test_the_trimmed_mean_holds_up_to_its_share_of_liars() -> None:
    assert steady("trimmed-mean", 1, share=0.2)[1] == pytest.approx([1])
    assert steady("trimmed-mean", 2, share=0.2)[1] == pytest.approx(
        [2 / 3]
    )  # one of three that are left
    assert steady("trimmed-mean", 2, share=0.4)[1] == pytest.approx([1])
    assert steady("trimmed-mean", 2, share=0)[1] == pytest.approx([3 / 5])  # the mean


def test_the_huber_mean_gives_way_a_little() -> None:
    """Two liars pull with 0.1 each, three honest raters with what they are away: 3 (1 - c) = 2 x
    0.1."""
    raters, providers = steady("huber-mean", 2)
    assert providers == pytest.approx([1 - 0.2 / 3])
    assert raters == pytest.approx([0.2 / 3] * 2 + [1 - 0.2 / 3] * 3)
    assert steady("huber-mean", 2, width=1)[1] == pytest.approx([3 / 5])  # the mean
