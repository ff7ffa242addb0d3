"""What is read back from a file of arrays: each is taken by name, and refused if it is of another
type or shape.
"""

from collections.abc import Callable
from itertools import count
from typing import Any

import numpy as np
import numpy.typing as npt


def taken(
    arrays: dict[str, npt.NDArray[Any]],
    name: str,
    dtype: Any,
    shape: tuple[int | None, ...],
    *,
    finite: bool = True,
) -> npt.NDArray[Any]:
    """Take a copy of an array from those of a file, which are without it then.

    Args:
        arrays: Arrays by name.
        name: Name of the array.
        dtype: Type that it must have.
        shape: Shape that it must have; None for an axis of any length.
        finite: Whether all of its values must be finite.

    Raises:
        ValueError: It is missing, has another type or shape, or has values that are not finite.
    """
    if name not in arrays:
        raise ValueError(f"{name} is missing")
    array = arrays.pop(name)
    sizes = zip(array.shape, shape, strict=False)
    if (
        array.ndim != len(shape)
        or array.dtype != dtype
        or any(needed not in (size, None) for size, needed in sizes)
    ):
        needed = tuple("any" if size is None else size for size in shape)
        raise ValueError(
            f"{name} has shape {array.shape} and type {array.dtype}; shape {needed} and type "
            f"{np.dtype(dtype)} belong"
        )
    if finite and not np.isfinite(array).all():
        raise ValueError(f"{name} has values that are not finite")
    return np.array(array)


def restoring(left: dict[str, npt.NDArray[Any]]) -> Callable[[Any], Any]:
    """Return a function that takes the next array of a state from stored ones, see `taken`.

    Its argument shows the shape and the type; a flag, a number or None of Python stays one.
    """
    places = count()

    def restored(leaf: Any) -> Any:
        if leaf is None:
            return None
        like = np.asarray(leaf)
        stored = taken(left, f"state_{next(places)}", like.dtype, like.shape)
        return stored if hasattr(leaf, "dtype") else stored.item()

    return restored


def taken_counts(arrays: dict[str, npt.NDArray[Any]]) -> tuple[int, int, int]:
    """Take the numbers of raters, of providers and of rounds from stored arrays; refuse others.

    Raises:
        ValueError: They are no three whole numbers from 0.
    """
    counts: tuple[int, int, int] = tuple(taken(arrays, "counts", np.int64, (3,)).tolist())
    if min(counts) < 0:
        raise ValueError(f"raters, providers and rounds are {counts}; none may be below 0")
    return counts
