"""Whom an attack is about: agents by their places on the rater or the provider axis."""

from typing import Annotated

from pydantic import Field, NonNegativeInt

from roletrust_env.arrays import Array, namespace

AgentIndices = Annotated[tuple[NonNegativeInt, ...], Field(min_length=1)]
"""Of providers or of raters, on their axis; at least one."""


def index_mask(places: tuple[int, ...], rows: Array, what: str, axis: str = "provider") -> Array:
    """Whether each provider, or each rater, is among some places.

    Args:
        places: on the axis of the providers, or of the raters.
        rows: an array with one row for each, (P, ...) or (S, ...).
        what: the places are, for error messages.
        axis: who the rows are, for error messages.

    Returns:
        Boolean, shape (P, 1 ...) or (S, 1 ...).

    Raises:
        ValueError: a place is beyond the last one.
    """
    count = rows.shape[0]
    if max(places, default=0) >= count:
        raise ValueError(f"{what} is {places}; the last {axis} is {count - 1}")
    chosen = namespace(rows).asarray([place in places for place in range(count)], device=rows.device)
    return chosen.reshape(-1, *[1] * (rows.ndim - 1))
