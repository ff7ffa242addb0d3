"""What is played with every trust model that has a name: rounds of ratings, and who is who."""

from collections.abc import Callable, Iterable, Iterator, Sequence
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
    return make_trust_model(name, **registry.accepted_parameters(name, {"lam": 0.7, "initial": 0.3}))


def assert_close(actual: Iterable[Any], expected: Iterable[Any], tolerance: float, what: str = "") -> None:
    for one, other in zip(actual, expected, strict=True):
        np.testing.assert_allclose(np.asarray(one), np.asarray(other), rtol=0, atol=tolerance, err_msg=what)


def having(*traits: str) -> pytest.MarkDecorator:
    """Parametrize by the names of the models that have all these traits."""
    found = {name: Traits.of(named(name)) for name in trust_models()}
    return pytest.mark.parametrize("name", [n for n, has in found.items() if all(getattr(has, t) for t in traits)])


Vector = list[float]
Matrix = list[Vector]
Reference = Callable[[Sequence[tuple[Matrix, Matrix]], Matrix], Iterator[tuple[Vector, Vector]]]
"""Takes the ratings and masks of one game's rounds and who is who; yields both trusts after each round."""


def assert_matches(model: TrustModel[Any], reference: Reference, count: int = 15) -> None:
    """The model computes what a slow reference does, after every round, on NumPy and in single precision on torch."""
    for seed, shape in enumerate([(3, 3, 2), (1, 4, 2), (4, 1, 2), (1, 1, 1), (6, 5, 2)]):
        rounds, peers = random_rounds(shape, count, seed=seed), who_is_who(shape)
        state = play(model, [], np.zeros(shape), peers)
        single = play(model, [], torch.zeros(shape), peers, torch.asarray)
        slow = [
            reference([(r[..., e].tolist(), m[..., e].tolist()) for r, m in rounds], peers.tolist())
            for e in range(shape[2])
        ]
        for (ratings, mask), *games in zip(rounds, *slow, strict=True):
            expected = [np.stack(trust, -1) for trust in zip(*games, strict=True)]
            state = model.update(state, Ratings(ratings, mask))
            single = model.update(single, Ratings(torch.asarray(ratings.astype(np.float32)), torch.asarray(mask)))
            assert_close(read(model, state), expected, 1e-9)
            assert_close(read(model, single), expected, 1e-4)
