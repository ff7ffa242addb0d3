"""What is played with every trust model that has a name: rounds of ratings, and who is who."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import pytest
import torch

from roletrust_env.testing.trust_models import RoundRatings, random_rounds
from roletrust_env.testing.trust_models import play_rounds as play
from roletrust_env.testing.trust_models import read_trust as read
from roletrust_env.testing.trust_models import some_peers as who_is_who
from roletrust_env.trees import arrays
from roletrust_env.trust import Ratings, Traits, TrustModel, make_trust_model, trust_models
from roletrust_env.trust.model import registry

__all__ = ["EVERY_MODEL", "RoundRatings", "arrays", "play", "random_rounds", "read", "who_is_who"]

EVERY_MODEL = pytest.mark.parametrize("name", trust_models())


def named(name: str) -> TrustModel[Any]:
    """The model of that name, with a `lam` of 0.7 and an `initial` of 0.3 if it takes them."""
    return make_trust_model(
        name, **registry.accepted_parameters(name, {"lam": 0.7, "initial": 0.3})
    )


def assert_close(
    actual: Iterable[Any], expected: Iterable[Any], tolerance: float, what: str = ""
) -> None:
    for one, other in zip(actual, expected, strict=True):
        np.testing.assert_allclose(
            np.asarray(one), np.asarray(other), rtol=0, atol=tolerance, err_msg=what
        )


def having(*traits: str) -> pytest.MarkDecorator:
    """Parametrize by the names of the models that have all these traits."""
    found = {name: Traits.of(named(name)) for name in trust_models()}
    return pytest.mark.parametrize(
        "name", [n for n, has in found.items() if all(getattr(has, t) for t in traits)]
    )


Vector = list[float]
Matrix = list[Vector]
Rounds = Sequence[tuple[Matrix, Matrix]]
"""Ratings and masks of the rounds of one game."""
Reference = Callable[[Rounds, Matrix], Iterable[tuple[Vector, Vector]]]
"""Takes the rounds of one game and who is who; yields both trusts after each round."""

SHAPES = [(3, 3, 2), (1, 4, 2), (4, 1, 2), (1, 1, 1), (5, 2, 2), (6, 5, 2)]


def varied_rounds(shape: tuple[int, ...], count: int, seed: int) -> list[RoundRatings]:
    """Random rounds: the last of each role come late, and of four raters one copies the first, and
    one is near it.

    By an odd seed, ratings are near the quality of the providers, and the first rater lies.
    """
    rng, found = np.random.default_rng(seed), []
    quality = rng.random((1, *shape[1:]))
    for now, (ratings, mask) in enumerate(random_rounds(shape, count, seed=seed)):
        f, m = np.nan_to_num(ratings), mask.copy()
        if seed % 2:
            f = np.clip(quality + 0.6 * (f - 0.5), 0, 1)
            f[0] = 1 - quality[0]
        if shape[0] > 3:
            f[1], f[2] = f[0], f[0] + 0.2 * (rng.random(f[0].shape) - f[0])
            m[1] = m[0]
        if now < count // 3:
            m[-1:] &= shape[0] == 1
            m[:, -1:] &= shape[1] == 1
        found.append(RoundRatings.of(f.astype(np.float32).astype(float), m))
    return found


def assert_matches(model: TrustModel[Any], reference: Reference, count: int = 15) -> None:
    """The model computes what a slow reference does, after every round, on NumPy and in single
    precision on torch."""
    for seed, shape in enumerate(SHAPES):
        rounds, peers = varied_rounds(shape, count, seed), who_is_who(shape)
        state = play(model, [], np.zeros(shape), peers)
        single = play(model, [], torch.zeros(shape), peers, torch.asarray)
        slow = [
            reference([(r[..., e].tolist(), m[..., e].tolist()) for r, m in rounds], peers.tolist())
            for e in range(shape[2])
        ]
        for (ratings, mask), *games in zip(rounds, *slow, strict=True):
            expected = [np.stack(trust, -1) for trust in zip(*games, strict=True)]
            state = model.update(state, Ratings(ratings, mask))
            single = model.update(
                single, Ratings(torch.asarray(ratings.astype(np.float32)), torch.asarray(mask))
            )
            assert_close(read(model, state), expected, 1e-9)
            assert_close(read(model, single), expected, 1e-4)
