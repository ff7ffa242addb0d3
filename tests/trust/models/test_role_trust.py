"""Role-trust is the paper's two algorithms, which are tested on their own, and their memory."""

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
import reference as paper
from model_cases import Matrix, Vector, assert_matches, named, random_rounds

from roletrust_env.trust import Ratings, make_trust_model, provider_trust, rater_trust

LAM, INITIAL = 0.7, 0.3  # of `named`


def reference(
    rounds: Sequence[tuple[Matrix, Matrix]], peers: Matrix
) -> Iterator[tuple[Vector, Vector]]:
    tor, top = [INITIAL for _ in peers], [INITIAL for _ in peers[0]]
    last, elapsed = [[0.0 for _ in row] for row in peers], [[0.0 for _ in row] for row in peers]
    for ratings, mask in rounds:
        tor = paper.rater_trust(ratings, mask, tor, LAM)
        top = paper.provider_trust(ratings, mask, tor, top, last, elapsed, LAM)
        for i, row in enumerate(mask):
            for j, rated in enumerate(row):
                if rated:
                    last[i][j], elapsed[i][j] = ratings[i][j], 1
                elif elapsed[i][j]:
                    elapsed[i][j] += 1
        yield tor, top


def test_the_model_matches_its_reference() -> None:
    assert_matches(named("role-trust"), reference)


@pytest.mark.parametrize("shape", [(3, 3), (1, 4), (2, 5, 6), (4, 2, 3, 2)], ids=str)
def test_role_trust_is_the_two_algorithms_and_their_memory(shape: tuple[int, ...]) -> None:
    model = make_trust_model("role-trust", lam=0.6, initial=0.4)
    assert model.rates_raters
    state = model.start(np.zeros(shape))
    tor, top = np.full((shape[0], *shape[2:]), 0.4), np.full(shape[1:], 0.4)
    last, when = np.zeros(shape), np.full(shape, -1)
    for now, (ratings, mask) in enumerate(random_rounds(shape, 30)):
        state = model.update(state, Ratings(ratings, mask))
        elapsed = np.where(when < 0, 0, now - when)
        tor = rater_trust(ratings, mask, previous=tor, lam=0.6)
        top = provider_trust(
            ratings, mask, tor=tor, previous=top, lam=0.6, last_ratings=last, elapsed=elapsed
        )
        last, when = np.where(mask, ratings, last), np.where(mask, now, when)
        np.testing.assert_allclose(model.rater_trust(state), tor, rtol=0, atol=1e-12)
        np.testing.assert_allclose(model.provider_trust(state), top, rtol=0, atol=1e-12)
