"""Checks of the contract of trust models, each for one rule, and all of them together."""

import copy
import warnings
from collections.abc import Callable, Iterable
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import truth_value
from roletrust_env.randomness import generator
from roletrust_env.trees import arrays, check_ranges
from roletrust_env.trust import Ratings, TrustModel
from roletrust_env.trust.model import start_model
from roletrust_env.trust.model_checks import try_trust_model as check_one_round

Floats = npt.NDArray[Any]
Shape = tuple[int, ...]


class RoundRatings(NamedTuple):
    """The ratings of one round, shape (S, P, ...), and the mask of the pairs that met; NaN outside
    the mask.
    """

    ratings: Floats
    mask: npt.NDArray[np.bool_]

    @classmethod
    def of(cls, ratings: Floats, mask: npt.NDArray[np.bool_]) -> "RoundRatings":
        """Return the ratings with NaN outside the mask."""
        return cls(np.where(mask, ratings, ratings.dtype.type(np.nan)), mask)

    def given(self, asarray: Callable[..., Any] = np.asarray) -> Ratings:
        """Return them as a model gets them, in another array library."""
        return Ratings(asarray(self.ratings), asarray(self.mask))


def random_rounds(
    shape: Shape, count: int = 12, dtype: Any = np.float64, seed: int = 0
) -> list[RoundRatings]:
    """Return rounds of random ratings, with some in which no pair, every pair or not every agent
    takes part.

    Args:
        shape: Shape of the ratings, (S, P, ...).
        count: Number of rounds.
        dtype: Dtype of the ratings. The values are those of float32.
        seed: Random seed.
    """
    rng, rounds = generator(seed), []
    for _ in range(count):
        mask = rng.random(shape) < rng.choice([0.0, 0.5, 0.5, 0.8, 1.0])
        mask[rng.integers(shape[0]), :, ...] &= rng.random() < 0.5
        mask[:, rng.integers(shape[1]), ...] &= rng.random() < 0.5
        rounds.append(RoundRatings.of(rng.random(shape).astype(np.float32).astype(dtype), mask))
    return rounds


def some_peers(shape: Shape) -> npt.NDArray[np.bool_]:
    """Return peers, shape (S, P), in which the last raters are the last providers, as many as half
    of the fewer.
    """
    s, p = shape[:2]
    peers = np.zeros((s, p), bool)
    for k in range(1, 1 + min(s, p) // 2):
        peers[-k, -k] = True
    return peers


def play_rounds(
    model: TrustModel[Any],
    rounds: Iterable[RoundRatings],
    like: Array,
    peers: npt.NDArray[np.bool_] | None = None,
    asarray: Callable[..., Any] = np.asarray,
) -> Any:
    """Return the state of a trust model after some rounds.

    Args:
        model: Trust model.
        rounds: Rounds, in order.
        like: Array of the shape, library and dtype of the ratings.
        peers: Pairs that are one agent, (S, P); by default `some_peers`.
        asarray: Function that brings an array of NumPy into the library of `like`.
    """
    peers = some_peers(like.shape) if peers is None else peers
    state = start_model(model, like, asarray(peers))
    for played in rounds:
        state = model.update(state, played.given(asarray))
    return state


def read_trust(model: TrustModel[Any], state: Any) -> tuple[Any, Any]:
    """Return the trust of the raters and that of the providers."""
    return model.rater_trust(state), model.provider_trust(state)


def check_trust_model(model: TrustModel[Any], *, torch: bool = True) -> None:
    """Check that a trust model keeps to the contract of `TrustModel`.

    The model has to keep shapes and dtypes, return trust in [0, 1], leave its inputs, its state and
    itself unchanged, take rounds without ratings and full ones, and treat the games of a batch
    independently, on NumPy and on torch.

    Args:
        model: Trust model.
        torch: Whether to check on torch, too, if it is installed.

    Raises:
        ValueError: The model cannot play one round, see `try_trust_model`.
        AssertionError: The model breaks another rule. The message says which one and what to
            change.

    Warns:
        UserWarning: The trust of an agent depends on its position among the agents. Rules that name
            agents by position do that on purpose; in other models it is a mistake.

    Example:
        >>> from roletrust_env import make_trust_model
        >>> check_trust_model(make_trust_model("role-trust"))
    """
    if isinstance(model, type):
        raise ValueError(
            f"trust model {model.__name__} is a class; check an object: {model.__name__}()"
        )
    if not isinstance(model, TrustModel):
        raise ValueError(
            f"{model!r} is no trust model; it needs rates_raters, start, update and both trusts"
        )
    with_torch = truth_value("torch", torch) and find_spec("torch") is not None
    for like in (np.zeros(()), np.zeros((), np.float32), *(_tensors() if with_torch else ())):
        check_one_round(model, namespace(like).asarray(np.zeros((3, 3), bool)), like)
    for shape in ((3, 3), (1, 4), (2, 5, 6)):
        for dtype in (np.float32, np.float64):
            check_kinds(model, shape, dtype)
        check_purity(model, shape)
        check_silence(model, shape)
        check_batch(model, (*shape[:2], 3))
        if with_torch:
            check_torch(model, shape)
    check_full_rounds(model, (3, 4, 2))
    try:
        for seed in range(3):
            check_permutation(model, seed)
    except AssertionError as hint:
        warnings.warn(str(hint), UserWarning, stacklevel=2)


def check_kinds(model: TrustModel[Any], shape: Shape, dtype: Any) -> None:
    """Check shapes, dtypes and ranges in every round; the state must keep the shape and dtype of
    its arrays.
    """
    state = start_model(model, np.zeros(shape, dtype), some_peers(shape))
    before = _kinds(model, state, shape)
    for number, played in enumerate(random_rounds(shape, dtype=dtype), 1):
        state = model.update(state, played.given())
        try:
            check_ranges(state, number)
        except ValueError as error:
            raise AssertionError(_line(model, f"{error}, as its annotation says")) from None
        _require(
            _kinds(model, state, shape) == before,
            model,
            "update changes the shape or dtype of its state; keep both",
        )
        for name, trust, n in zip(
            ("rater_trust", "provider_trust"), read_trust(model, state), shape, strict=False
        ):
            needed = (n, *shape[2:])
            _require(
                trust.shape == needed, model, f"{name} has shape {trust.shape}; it must be {needed}"
            )
            _require(
                trust.dtype == dtype,
                model,
                f"{name} is {trust.dtype}; it must be {np.dtype(dtype)}, as the ratings",
            )
            inside = bool(np.all((trust >= 0) & (trust <= 1)))
            _require(
                inside,
                model,
                f"{name} is NaN or outside [0, 1]; clip it, and divide only where a rating is",
            )


def check_purity(model: TrustModel[Any], shape: Shape) -> None:
    """Check that the same input has the same result twice, and that inputs, state and model stay
    unchanged.
    """
    itself = copy.deepcopy(vars(model)) if hasattr(model, "__dict__") else {}
    rounds = random_rounds(shape)
    state = play_rounds(model, [], np.zeros(shape))
    for played in rounds:
        before = [np.copy(leaf) for leaf in arrays(state)]
        given, right = played.given(), played.given()
        after = model.update(state, given)
        same = all(map(_equal, arrays(state), before))
        _require(same, model, "update changes the state that it is given; return a new one")
        same = _equal(given.values, right.values) and _equal(given.weights, right.weights)
        _require(same, model, "update writes to its arguments; copy them")
        again = model.update(state, right)
        same = all(map(_equal, read_trust(model, after), read_trust(model, again)))
        _require(
            same,
            model,
            "the same round has two results; keep all memory in the state, and use no random "
            "numbers",
        )
        state = after
    first = read_trust(model, state)
    _require(
        all(map(_equal, first, read_trust(model, state))),
        model,
        "reading the trust changes it; do not write to it",
    )
    known = vars(model) if hasattr(model, "__dict__") else {}
    same = known.keys() == itself.keys() and all(
        _equal(known[name], itself[name]) for name in itself
    )
    _require(same, model, "the model changes its own attributes; keep all memory in the state")


def check_silence(model: TrustModel[Any], shape: Shape) -> None:
    """Check that a round without ratings is valid, before any other and after many."""
    silence = RoundRatings.of(np.zeros(shape), np.zeros(shape, bool))
    for played in ([silence] * 3, [*random_rounds(shape), silence]):
        for trust in read_trust(model, play_rounds(model, played, np.zeros(shape))):
            inside = bool(np.all((trust >= 0) & (trust <= 1)))
            _require(
                inside,
                model,
                "trust is NaN or outside [0, 1] where no pair met; divide only where a rating is",
            )


def check_batch(model: TrustModel[Any], shape: Shape) -> None:
    """Check that each game of a batch has the result that it has alone."""
    rounds = random_rounds(shape)
    together = read_trust(model, play_rounds(model, rounds, np.zeros(shape)))
    for index in np.ndindex(shape[2:]):
        single = [RoundRatings(ratings[..., *index], mask[..., *index]) for ratings, mask in rounds]
        alone = read_trust(model, play_rounds(model, single, np.zeros(shape[:2])))
        same = all(map(_near, alone, (trust[..., *index] for trust in together)))
        _require(
            same,
            model,
            "a game in a batch differs from the same game alone; reduce over axes 0 and 1 only",
        )


def check_permutation(model: TrustModel[Any], seed: int = 0) -> None:
    """Check that the trust of an agent does not depend on its position among the agents."""
    rng, shape = generator(seed), (5, 4, 3)
    rounds, peers = random_rounds(shape, seed=seed), some_peers(shape)
    raters, providers = read_trust(model, play_rounds(model, rounds, np.zeros(shape), peers))
    i, j = _moved(shape[0], rng), _moved(shape[1], rng)
    permuted = [RoundRatings(ratings[i][:, j], mask[i][:, j]) for ratings, mask in rounds]
    trust = read_trust(model, play_rounds(model, permuted, np.zeros(shape), peers[i][:, j]))
    same = all(map(_near, trust, (raters[i], providers[j])))
    _require(
        same,
        model,
        "the order of the agents counts; if that is no intention, treat all agents alike",
    )


def check_full_rounds(model: TrustModel[Any], shape: Shape) -> None:
    """Check that a mask of None has the result of a mask that is true everywhere, in any order of
    rounds.
    """
    rng = np.random.default_rng(1)
    state = masked = play_rounds(model, [], np.zeros(shape))
    for played in random_rounds(shape, 30):
        if rng.random() < 0.6:
            played = RoundRatings(rng.random(shape), np.ones(shape, bool))
        state = model.update(
            state, Ratings(played.ratings) if played.mask.all() else played.given()
        )
        masked = model.update(masked, played.given())
        same = all(map(_near, read_trust(model, state), read_trust(model, masked)))
        _require(
            same,
            model,
            "a round without a mask differs from one with a mask that is true everywhere; use "
            "ratings.weights, which "
            "every round has",
        )


def check_torch(model: TrustModel[Any], shape: Shape) -> None:
    """Check that torch computes the trust that NumPy does."""
    import torch

    rounds = random_rounds(shape)
    try:
        state = play_rounds(
            model, rounds, torch.zeros(shape, dtype=torch.float64), asarray=torch.asarray
        )
        torch_trust = [trust.detach().numpy() for trust in read_trust(model, state)]
    except Exception as error:  # a model of another package may raise anything
        raise AssertionError(
            _line(model, f"it fails on torch, {type(error).__name__}: {error}; {_ON_TORCH}")
        ) from error
    expected = read_trust(model, play_rounds(model, rounds, np.zeros(shape)))
    _require(
        all(map(_near, torch_trust, expected)),
        model,
        f"torch and NumPy have different results; {_ON_TORCH}",
    )


_ON_TORCH = "use operators and roletrust_env.arrays.namespace(ratings.values) in place of numpy"


def _tensors() -> list[Any]:
    import torch

    return [torch.zeros(()), torch.zeros((), dtype=torch.float64)]


def _kinds(model: TrustModel[Any], state: Any, shape: Shape) -> list[tuple[Shape, Any]]:
    """Return the shape and the dtype of each array of a state, each with the batch on its last
    axes.
    """
    leaf_kinds = []
    for leaf in arrays(state):
        is_array = hasattr(leaf, "shape") and hasattr(leaf, "dtype")
        _require(
            is_array,
            model,
            f"the state holds {leaf!r}; a state is a NamedTuple of arrays, None or flags",
        )
        batched = tuple(leaf.shape[leaf.ndim - len(shape[2:]) :]) == shape[2:]
        _require(
            batched,
            model,
            f"an array of the state has shape {leaf.shape}; its last axes must be the batch",
        )
        leaf_kinds.append((tuple(leaf.shape), leaf.dtype))
    return leaf_kinds


def _moved(n: int, rng: np.random.Generator) -> npt.NDArray[np.intp]:
    """Return an order of n agents in which each has another position than before."""
    while True:
        order = rng.permutation(n)
        if not (order == np.arange(n)).any():
            return order


def _equal(own: Any, other: Any) -> bool:
    if isinstance(own, np.ndarray):
        return bool(np.array_equal(own, other, equal_nan=own.dtype.kind == "f"))
    return bool(np.all(own == other))


def _near(own: Any, other: Any) -> bool:
    return bool(np.allclose(own, other, rtol=0, atol=1e-9))


def _line(model: Any, fault: str) -> str:
    return f"trust model {model!r}: {fault}"


def _require(holds: bool, model: Any, fault: str) -> None:
    if not holds:
        raise AssertionError(_line(model, fault))
