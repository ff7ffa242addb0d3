"""Whole games of ratings as plain lists, for references that are written from a formula, loop by loop."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from roletrust_env.trust import Ratings, TrustModel

History = list[list[list[float | None]]]
"""Ratings by round, rater and provider; None where there is none."""

Trusts = list[tuple[list[float], list[float]]]
"""By round, the trust of the raters and that of the providers."""

SIZES = [(4, 3), (6, 5), (1, 3), (3, 1), (1, 1), (5, 2)]


def random_history(raters: int, providers: int, seed: int, rounds: int = 15) -> History:
    """A game in which pairs meet by chance, the last of each role come late, and nobody rates in round 4.

    Where there are many raters, one copies another, and one is near to it.
    """
    rng = np.random.default_rng(seed)
    notes, met = rng.random((rounds, raters, providers)), rng.random((rounds, raters, providers)) < rng.uniform(0.3, 1)
    met[4] = False
    met[:6, raters - 1 :, :] &= raters == 1
    met[:8, :, providers - 1 :] &= providers == 1
    if raters > 3:
        notes[:, 1], notes[:, 2] = notes[:, 0], notes[:, 0] + 0.2 * (notes[:, 2] - notes[:, 0])
        met[:, 1] = met[:, 0]
    given: History = np.where(met, notes, None).tolist()
    return given


def played(model: TrustModel[Any], histories: list[History], like: Any) -> list[Trusts]:
    """The trust in each of some games of one size, played as a batch; `like` shows the library and the dtype."""
    asarray: Any = torch.asarray if isinstance(like, torch.Tensor) else np.asarray
    cells = np.moveaxis(np.array(histories, float), 0, -1)  # None becomes NaN
    state = model.start(asarray(cells[0], dtype=like.dtype))
    found = []
    for ratings in cells:
        state = model.update(state, Ratings(asarray(ratings, dtype=like.dtype), asarray(~np.isnan(ratings))))
        found.append((np.asarray(model.rater_trust(state)), np.asarray(model.provider_trust(state))))
    return [[(tor[:, e].tolist(), top[:, e].tolist()) for tor, top in found] for e in range(len(histories))]


def check_against(slow: Callable[[History], Trusts], model: TrustModel[Any]) -> None:
    """See that a model computes what a slow reference does, in every round of many games."""
    for raters, providers in SIZES:
        histories = [random_history(raters, providers, seed) for seed in range(4)]
        wanted = [slow(history) for history in histories]
        for like, tolerance in ((np.zeros(()), 1e-9), (torch.zeros(()), 1e-4)):
            for expected, found in zip(wanted, played(model, histories, like), strict=True):
                for right, trusts in zip(expected, found, strict=True):
                    np.testing.assert_allclose(trusts[0], right[0], rtol=0, atol=tolerance)
                    np.testing.assert_allclose(trusts[1], right[1], rtol=0, atol=tolerance)


def mean(values: list[float], otherwise: float) -> float:
    """The mean of some values, or something else if there are none."""
    return sum(values) / len(values) if values else otherwise
