"""The deviation-weighted mean against loops, and by hand."""

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
    raters, providers = range(len(peers)), range(len(peers[0]))
    tor, top = [INITIAL for _ in raters], [INITIAL for _ in providers]
    for ratings, mask in rounds:
        of = {j: [i for i in raters if mask[i][j]] for j in providers}
        averages = {j: fmean(ratings[i][j] for i in of[j]) for j in providers if of[j]}
        for i in raters:
            if distances := [abs(ratings[i][j] - averages[j]) for j in averages if mask[i][j]]:
                tor[i] = LAM * (1 - fmean(distances)) + (1 - LAM) * tor[i]
        for j in averages:
            quality = sum(tor[i] * ratings[i][j] for i in of[j]) / sum(tor[i] for i in of[j])
            top[j] = LAM * quality + (1 - LAM) * top[j]
        yield list(tor), list(top)


def test_the_model_matches_its_reference() -> None:
    assert_matches(named("deviation-weighted"), reference)


def test_a_lone_liar_counts_less() -> None:
    """Of three, one rates 0: the average is 2/3, so the honest are 1/3 away and the liar 2/3; 4/3
    of 5/3 are honest."""
    model = make_trust_model("deviation-weighted")
    ratings = np.array([[0.0], [1.0], [1.0]])
    state = model.start(ratings)
    for _ in range(60):
        state = model.update(state, Ratings(ratings))
    assert model.rater_trust(state) == pytest.approx([1 / 3, 2 / 3, 2 / 3])
    assert model.provider_trust(state) == pytest.approx([4 / 5])
