"""Checks of trust models from other packages: before a game, and in each round."""

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from roletrust_env.arrays import Array, copy, is_compiling, library_of, namespace
from roletrust_env.shapes import PerProvider, PerRater
from roletrust_env.trust.model import Peers, State, TrustModel, start_model
from roletrust_env.trust.models import OWN
from roletrust_env.trust.random_order import RandomOrder
from roletrust_env.trust.ratings import Ratings


def needs_watching(model: Any) -> bool:
    """Return whether a model comes from another package. Our own models are tested, and checks take
    time.
    """
    return not is_own(type(_inside(model)))


def _inside(model: Any) -> Any:
    return model.model if type(model) is RandomOrder else model


def is_own(factory: Callable[..., Any]) -> bool:
    """Return whether a class is a trust model of this package: one of a list, since a class may say
    what it likes.
    """
    return any(factory is own for own in OWN.values())


def try_trust_model(model: TrustModel[Any], peers: Peers, like: Array) -> None:
    """Try a model on one round, in which all pairs but the first meet and all ratings are low.

    A model from another package plays the round twice. It must not change its inputs and must not
    keep data in itself: otherwise the games of a batch, of a planner and after a reset would
    influence each other.

    Args:
        model: Model to try.
        peers: Pairs, shape (S, P), boolean, true where a rater and a provider are one agent.
        like: Array of the library, dtype and device of the game.

    Raises:
        ValueError: If the model raises an exception; if a read-out is not an array of the game's
            library and dtype, has the wrong shape or is not in [0, 1]; or if the second play of the
            round has another result.
    """
    if is_compiling(like):  # compiled code cannot raise errors, and the model has been tried
        return
    xp, where = namespace(like), f"trust model {model!r} cannot play one round"
    _check_update(model)
    values = xp.zeros((*peers.shape, 1), dtype=like.dtype, device=like.device) + 0.25
    mask = xp.asarray(
        np.arange(peers.shape[0] * peers.shape[1]).reshape(*peers.shape, 1) > 0, device=like.device
    )
    ratings = Ratings(values, mask)
    given = copy(ratings.values)
    try:
        start = start_model(model, values, peers)
    except Exception as error:  # a model of another package may raise anything
        raise ValueError(f"{where}: {type(error).__name__}: {error}{_on_library(like)}") from error
    _, *trusts = _updated(model, start, ratings, where, _on_library(like))
    if not needs_watching(model):
        return
    same = bool((ratings.values == given).all()) and bool((ratings.weights == given / 0.25).all())
    if not same or bool(mask[0, 0].any()) or int(mask.sum()) != len(peers[0]) * len(peers) - 1:
        raise ValueError(
            f"{where}: it writes to the ratings or to the mask, which it must leave as they are"
        )
    first = [copy(trust) for trust in trusts]
    for changes, state in (
        ("itself", start_model(model, values, peers)),
        ("the state it is given", start),
    ):
        _, *again = _updated(model, state, ratings, where)
        if any(
            bool((abs(first_trust - other) > 1e-6).any())
            for first_trust, other in zip(first, again, strict=True)
        ):
            raise ValueError(
                f"{where} twice alike: it changes {changes}, and must return what it remembers anew"
            )
    _check_batch(_inside(model), peers, values, where)


def _check_batch(model: TrustModel[Any], peers: Array, like: Array, where: str) -> None:
    """Refuse a model with another trust in games side by side than in each alone. Ratings are in
    tenths.

    Raises:
        ValueError: It is such a model.
    """
    xp, shape, games = namespace(like), tuple(like.shape[:2]), 3
    tenths = (
        np.arange(shape[0] * shape[1] * games).reshape(*shape, games) * 7 % 11
    )  # those of 10 are no ratings
    mask = xp.asarray(tenths < 10, device=like.device)
    values = xp.asarray(
        np.where(tenths < 10, tenths / 10, 0.0), dtype=like.dtype, device=like.device
    )

    def read(games: slice) -> tuple[Array, Array]:
        start = start_model(model, 0 * values[..., games], peers)
        return _updated(model, start, Ratings(values[..., games], mask[..., games]), where)[1:]

    together = read(slice(games))
    for k in range(games):
        for alone, other in zip(read(slice(k, k + 1)), together, strict=True):
            if bool((abs(alone - other[..., k : k + 1]) > 1e-3).any()):
                raise ValueError(
                    f"{where}: a game in a batch differs from the same game alone; reduce over "
                    "axes 0 and 1 only"
                )


def watched_update(
    model: TrustModel[State], state: State, ratings: Ratings, round: Array
) -> tuple[State, PerRater, PerProvider]:
    """Return the state after a round and the trust of raters and of providers, once these are
    checked.

    Args:
        model: Trust model, see `TrustModel`.
        state: State of the model before the round.
        ratings: Ratings, on a grid or on edges, see `TrustModel.update`.
        round: Number of rounds played so far, (...), for the error.

    Raises:
        ValueError: If the model raises an exception, or if a read-out has another shape than (S,
            ...) and (P, ...) or another dtype than the ratings, is NaN or outside [0, 1]. The
            message names the model and the round.
    """
    if is_compiling(ratings.values):  # compiled code cannot raise errors
        after = model.update(state, ratings)
        return after, model.rater_trust(after), model.provider_trust(after)
    where = f"trust model {model!r}, round {int(round.reshape(-1)[0])}"
    return _updated(model, state, ratings, where)


def _check_update(model: TrustModel[Any]) -> None:
    """Refuse a model whose `update` cannot be called with a state and ratings alone, such as one
    with a mask.

    Raises:
        ValueError: Its `update` needs another argument.
    """
    try:
        signature = inspect.signature(model.update)
    except (TypeError, ValueError):  # a callable without a signature, which the first round tries
        return
    try:
        signature.bind(None, None)
    except TypeError:
        raise ValueError(
            f"trust model {model!r} has update{signature}; it must be update(state, ratings), "
            "where ratings is a "
            "roletrust_env.trust.Ratings: ratings.values are 0 and ratings.weights are 0 where "
            "there is no rating"
        ) from None


def _updated(
    model: TrustModel[State], state: State, ratings: Ratings, where: str, advice: str = ""
) -> tuple[State, Array, Array]:
    """Return the state after a round, and the valid trust of raters and providers."""
    try:
        after = model.update(state, ratings)
        of_raters, of_providers = model.rater_trust(after), model.provider_trust(after)
    except Exception as error:  # a model of another package may raise anything
        what = f"{type(error).__name__}: {error}{_shape_given(ratings)}{advice}"
        raise ValueError(f"{where}: {what}") from error
    values, (raters, providers) = ratings.values, ratings.shape
    _check("rater_trust", of_raters, (raters, *values.shape[2:]), values, where)
    _check("provider_trust", of_providers, (providers, *values.shape[2:]), values, where)
    return after, of_raters, of_providers


def _check(name: str, trust: Any, needed: tuple[int, ...], ratings: Array, where: str) -> None:
    """Refuse a read-out with another type, shape, dtype or range than the game needs."""
    if not isinstance(trust, type(ratings)):
        raise ValueError(
            f"{where}: {name} is of type {type(trust).__name__}; it must be a "
            f"{type(ratings).__name__} of shape "
            f"{needed}{_on_library(ratings)}"
        )
    shape = tuple(trust.shape)
    if shape != needed:
        raise ValueError(
            f"{where}: {name} must have shape {needed}, got {shape}{_shape_given(ratings)}"
        )
    if trust.dtype != ratings.dtype:
        raise ValueError(
            f"{where}: {name} is of dtype {trust.dtype}; it must be {ratings.dtype}, as the "
            "ratings are; create arrays "
            "with dtype=ratings.values.dtype, or from the ratings by arithmetic"
        )
    wrong = trust[~((trust >= 0) & (trust <= 1))]
    if len(wrong):
        raise ValueError(f"{where}: {name} holds {float(wrong[0])}; a trust must lie in [0, 1]")


def _shape_given(ratings: Any) -> str:
    """Return what a model must do with the games of a batch, for an error; nothing on edges."""
    shape = tuple((ratings.values if isinstance(ratings, Ratings) else ratings).shape)
    if len(shape) < 3:
        return ""
    return (
        f"; the model was given ratings of shape (S, P, games) = {shape}: reduce over axes 0 and "
        "1, and keep the others, as ratings.values.mean(axis=0) does"
    )


def _on_library(like: Array) -> str:
    """Advice for a model that was written for NumPy in double precision, where the game runs on
    something else.
    """
    if isinstance(like, np.ndarray):
        return (
            ""
            if like.dtype == np.float64
            else f"; the game runs on {library_of(like)}, see the dtype of the ratings"
        )
    return (
        f"; the game runs on {library_of(like)}: call the functions of "
        "roletrust_env.arrays.namespace(ratings.values) "
        "in place of those of numpy"
    )
