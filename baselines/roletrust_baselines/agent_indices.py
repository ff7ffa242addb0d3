"""Agents that an attack refers to, by their indices among the raters or the providers."""

from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeInt

from roletrust_env.arrays import Array, device_of, namespace
from roletrust_env.game.views import RaterView

AgentIndices = Annotated[tuple[NonNegativeInt, ...], Field(min_length=1)]
"""Indices of providers or of raters, at least one."""


def index_mask(
    indices: tuple[int, ...], rows: Array, parameter: str, axis: str = "provider"
) -> Array:
    """Return a mask over the providers or the raters that is true at some indices.

    Args:
        indices: Indices of providers or of raters.
        rows: Array with a row for each provider, shape (P, ...), or for each rater, shape (S, ...).
        parameter: Name of the parameter with the indices, for error messages.
        axis: Name of the agents in the rows, for error messages.

    Returns:
        Boolean array of shape (P, 1 ...) or (S, 1 ...).

    Raises:
        ValueError: An index is too large.
    """
    count = rows.shape[0]
    if max(indices, default=0) >= count:
        raise ValueError(f"{parameter} is {indices}; the last {axis} is {count - 1}")
    mask = namespace(rows).asarray(
        [index in indices for index in range(count)], device=device_of(rows)
    )
    return mask.reshape(-1, *[1] * (rows.ndim - 1))


def provider_mask(indices: tuple[int, ...], view: RaterView, parameter: str) -> Array:
    """Return a mask over the providers that a rater sees, which is true at some of them.

    Args:
        indices: Indices of providers.
        view: View of the rater.
        parameter: Name of the parameter with the indices, for error messages.

    Returns:
        Boolean array of shape (P, 1 ...); of shape (K, ...) in a `SparseGame`, where a rater sees
        whom it met.

    Raises:
        ValueError: An index is too large. In a `SparseGame`, such a provider is just never met.
    """
    met = getattr(view, "met", None)
    return (
        index_mask(indices, view.service, parameter)
        if met is None
        else np.isin(met, np.asarray(indices))
    )
