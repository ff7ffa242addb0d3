"""Central models on a list of edges: which run there, and how they start."""

from typing import Any

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.trees import Kind, arrays, kinds, map_kinds
from roletrust_env.trust.key_index import Ints
from roletrust_env.trust.model import Traits, TrustModel, start_model
from roletrust_env.trust.ratings import Ratings

_PROVIDER_BITS = 31


def pair_keys(raters: Ints, providers: Ints) -> Ints:
    """Return a whole number for each pair, from the places of its agents."""
    return (raters << _PROVIDER_BITS) | providers


def pair_ends(keys: Ints) -> tuple[Ints, Ints]:
    """Return the rater and the provider of each pair, from its key."""
    return keys >> _PROVIDER_BITS, keys & ((1 << _PROVIDER_BITS) - 1)


def check_keys(keys: Ints, shape: tuple[int, int]) -> None:
    """Refuse keys of pairs of other agents than so many raters and providers.

    Raises:
        ValueError: There is one.
    """
    for ends, size in zip(pair_ends(keys), shape, strict=True):
        if ((ends < 0) | (ends >= size)).any():
            raise ValueError("a pair has an agent that is not there")


def runs_on_edges(model: Any) -> bool:
    """Return whether a model is central, and its state says of every array which agents or pairs it
    is about.

    Raises:
        ValueError: The model cannot start.
    """
    if Traits.of(model).family != "central":
        return False
    grid = np.zeros((1, 1))
    try:
        state = start_model(model, grid, grid > 0)
    except Exception as error:  # a model of another package may raise anything
        raise ValueError(
            f"trust model {model!r} cannot start: {type(error).__name__}: {error}"
        ) from error
    try:
        return hasattr(state, "_fields") and len(list(kinds(state))) == len(arrays(state))
    except NameError:  # an annotation that is known to type checkers alone
        return False


def edge_model(model: Any) -> TrustModel[Any]:
    """Return a model if it runs on edges.

    Raises:
        ValueError: The model is personal, or an array of its state says not what it is about, see
            `PerRater`.
    """
    if not runs_on_edges(model):
        raise ValueError(
            f"trust model {model!r} does not run on edges: it is no central model whose state says "
            "by PerRater, "
            "PerProvider, PerPair and PairAge what its arrays are about; play its ratings on a grid"
        )
    checked: TrustModel[Any] = model
    return checked


def start_on_edges(
    model: Any, shape: tuple[int, int], like: Array | None = None, twins: Array | None = None
) -> Any:
    """Return the state before any rating, without known pairs.

    The formula of the start is that of the grid: all agents start alike, so a grid of one pair
    shows all values. Where trust depends on the number of agents, a round without ratings sets it.

    Args:
        model: Central model.
        shape: Number of raters S and number of providers P.
        like: Array of the library, dtype and device to use; float64 on NumPy if left out.
        twins: Place of the rater that is the same agent as each provider, see `Ratings`.
    """
    like = np.zeros(()) if like is None else like
    xp = namespace(like)
    grid = xp.zeros((1, 1), dtype=like.dtype, device=like.device)
    sizes = {"rater": shape[0], "provider": shape[1], "pair": 0, "age": 0}

    def spread(kind: Kind, leaf: Array) -> Array:
        return xp.zeros(sizes[kind], dtype=leaf.dtype, device=leaf.device) + leaf.reshape(-1)[0]

    state = map_kinds(spread, start_model(model, grid, grid > 0))
    return (
        model.update(state, no_ratings(grid[:, 0], shape, twins)) if takes_peers(model) else state
    )


def no_ratings(like: Array, shape: tuple[int, int], twins: Array | None = None) -> Ratings:
    """Return a round without ratings and without known pairs; `like` shows library and dtype."""
    xp = namespace(like)
    nobody = xp.zeros(0, dtype=xp.int64, device=like.device)
    return Ratings(like[:0], raters=nobody, providers=nobody, shape=shape, twins=twins)


def takes_peers(model: Any) -> bool:
    """Return whether trust depends on the number of agents, and on which rater is which
    provider.
    """
    return Traits.of(model).takes_peers
