"""What is played with every trust model that has a name: rounds of ratings, and who is who."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest
import torch

from roletrust_env.trust import Traits, TrustModel, make_trust_model, trust_models
from roletrust_env.trust.model import registry, start_model

EVERY_MODEL = pytest.mark.parametrize("name", trust_models())


class Round(NamedTuple):
    """One round of ratings, (S, P, ...) each; the ratings are NaN outside the mask."""

    ratings: np.ndarray
    mask: np.ndarray

    @classmethod
    def of(cls, ratings: np.ndarray, mask: np.ndarray) -> "Round":
        return cls(np.where(mask, ratings, ratings.dtype.type(np.nan)), mask)


def random_rounds(shape: tuple[int, ...], count: int = 12, dtype: type = np.float64, seed: int = 0) -> list[Round]:
    """About half of the pairs meet; now and then nobody does, everybody does, or an agent takes no part."""
    rng = np.random.default_rng(seed)
    rounds = []
    for _ in range(count):
        mask = rng.random(shape) < rng.choice([0.0, 0.5, 0.5, 0.8, 1.0])
        mask[rng.integers(shape[0]), :, ...] &= rng.random() < 0.5
        mask[:, rng.integers(shape[1]), ...] &= rng.random() < 0.5
        rounds.append(Round.of(rng.random(shape).astype(np.float32).astype(dtype), mask))
    return rounds


def who_is_who(shape: tuple[int, ...]) -> np.ndarray:
    """Peers, shape (S, P): the last raters are the last providers, as many as half of the fewer."""
    s, p = shape[:2]
    peers = np.zeros((s, p), bool)
    for k in range(1, 1 + min(s, p) // 2):
        peers[-k, -k] = True
    return peers


def named(name: str) -> TrustModel[Any]:
    """The model of that name, with a `lam` of 0.7 and an `initial` of 0.3 if it takes them."""
    return make_trust_model(name, **registry.accepted_parameters(name, {"lam": 0.7, "initial": 0.3}))


def play(
    model: TrustModel[Any],
    rounds: Iterable[Round],
    like: Any,
    peers: np.ndarray | None = None,
    asarray: Callable[..., Any] = np.asarray,
) -> Any:
    """The state after some rounds, whose arrays `asarray` brings into the library of `like`."""
    peers = who_is_who(like.shape) if peers is None else peers
    state = start_model(model, like, asarray(peers))
    for ratings, mask in rounds:
        state = model.update(state, asarray(ratings), asarray(mask))
    return state


def read(model: TrustModel[Any], state: Any) -> tuple[Any, Any]:
    """The trust of the raters and that of the providers."""
    return model.rater_trust(state), model.provider_trust(state)


def leaves(state: Any) -> list[Any]:
    """All that a state, a tuple of arrays and perhaps of tuples, consists of."""
    return [leaf for part in state for leaf in leaves(part)] if isinstance(state, tuple) else [state]


def assert_close(actual: Iterable[Any], expected: Iterable[Any], tolerance: float) -> None:
    for one, other in zip(actual, expected, strict=True):
        np.testing.assert_allclose(np.asarray(one), np.asarray(other), rtol=0, atol=tolerance)


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
            state = model.update(state, ratings, mask)
            single = model.update(single, torch.asarray(ratings.astype(np.float32)), torch.asarray(mask))
            assert_close(read(model, state), expected, 1e-9)
            assert_close(read(model, single), expected, 1e-4)
