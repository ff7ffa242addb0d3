"""Functions that NumPy and torch do not share under one name, chosen by the array library of the
input.
"""

from functools import lru_cache
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np
from array_api_compat import array_namespace

from roletrust_env.errors import printable

Array: TypeAlias = Any
"""A NumPy array or a torch tensor. Axis 0 is the rater, axis 1 the provider, every further axis is
batch."""

# The C library of Linux gives freed arrays above 128 KiB back to the system, and fetches the pages
# of the next one anew, which may cost more than the arithmetic. Once an array of 32 MB has been
# made and freed, the limit is its size.
np.empty(4_000_000)

_NUMPY = (np.ndarray, np.generic)
_NAMESPACES: dict[type, ModuleType] = {}
"""Array namespace of each type of array seen so far. A compiler can trace a look-up in a dict, but
not a cache."""


def namespace(array: Array) -> ModuleType:
    """Return the array namespace of an array, so that the same code runs on every array library.

    NumPy 2 follows the array API standard. It is returned as it is, because a wrapper would double
    the time of a small game.

    Args:
        array: NumPy array or scalar, or an array of any library that array-api-compat supports
            (torch, ...).

    Returns:
        `numpy` itself, or the namespace that array-api-compat gives.
    """
    if isinstance(array, _NUMPY):
        return np
    array_type = type(array)
    if array_type not in _NAMESPACES:
        _NAMESPACES[array_type] = array_namespace(array)
    return _NAMESPACES[array_type]


def numpy_array(what: str, values: Any, needed: str) -> np.ndarray[Any, Any]:
    """Return what a user gave as an array of NumPy.

    Args:
        what: What it is, for the error message.
        values: Array of any library, or lists.
        needed: What it must be.

    Raises:
        ValueError: It has rows of unequal lengths, is a tensor that NumPy cannot have, or hides
            entries behind a mask.
    """
    try:
        array = np.asarray(values)
    except (ValueError, TypeError, RuntimeError) as error:
        raise ValueError(
            f"{what} is no array: {printable(str(error))}; it must be {needed}"
        ) from None
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise ValueError(f"{what} is masked in some places; it must be {needed}, all there")
    return array


def device_of(array: Array) -> Any:
    """Return the device of an array; None, the default device, while JAX traces, where an array has
    none.
    """
    return getattr(array, "device", None)


def whole_dtype(array: Array) -> Any:
    """Return the dtype of whole numbers in the library of an array: int64, or int32 in JAX's usual
    precision.
    """
    return namespace(array).asarray(0).dtype


def library_of(like: Array) -> str:
    """Return the array library and the dtype of an array, such as `torch float32`."""
    return f"{type(like).__module__.partition('.')[0]} {str(like.dtype).rpartition('.')[2]}"


def largest(array: Array, axis: int = 0) -> Array:
    """Return the maximum along an axis, see `total`."""
    return (
        np.maximum.reduce(array, axis)
        if isinstance(array, np.ndarray)
        else namespace(array).max(array, axis=axis)
    )


def smallest(array: Array, axis: int = 0) -> Array:
    """Return the minimum along an axis, see `total`."""
    return (
        np.minimum.reduce(array, axis)
        if isinstance(array, np.ndarray)
        else namespace(array).min(array, axis=axis)
    )


def total(array: Array, axis: int) -> Array:
    """Return the sum along an axis.

    For small NumPy arrays, `np.add.reduce` takes half the time of the method `sum`, which calls it.
    """
    return np.add.reduce(array, axis) if isinstance(array, np.ndarray) else array.sum(axis=axis)


def copy(array: Array) -> Array:
    """Return a copy of an array. A compiler does not support the copies of `asarray`."""
    return array.copy() if isinstance(array, np.ndarray) else array + 0


def cast(array: Array, dtype: Any) -> Array:
    """Return an array in another dtype. NumPy scalars are allowed, unlike in `astype` of the array
    API standard.
    """
    return (
        array.astype(dtype) if isinstance(array, _NUMPY) else namespace(array).astype(array, dtype)
    )


def all_within(values: Array, low: float = 0.0, high: float = 1.0) -> Array:
    """Return whether no value is NaN or outside [low, high], as a flag of the array's library."""
    return ((values >= low) & (values <= high)).all()


def within(values: Array, low: float = 0.0, high: float = 1.0) -> bool:
    """Return whether no value is NaN or outside [low, high]."""
    if not isinstance(values, np.ndarray):
        return bool(all_within(values, low, high))
    if not values.size:
        return True
    return bool(values.min() >= low and values.max() <= high)  # both are NaN if a value is


def check_within(what: str, values: Array, low: float = 0.0, high: float = 1.0) -> None:
    """Refuse values that are NaN or outside [low, high].

    Args:
        what: Name of the values in the error.
        values: Array of any library.
        low: Least value that is allowed.
        high: Greatest value that is allowed.

    Raises:
        ValueError: A value is not allowed. The message names the first one.
    """
    if not within(values, low, high):
        wrong = values[~((values >= low) & (values <= high))]
        raise ValueError(f"{what} must be in [{low:g}, {high:g}], got {wrong[0]}")


def mean_or_zero(values: Array, mask: Array) -> Array:
    """Return the mean along the first axis over the entries where the mask is true, and 0 where it
    never is.

    Args:
        values: Finite values, shape (n, ...).
        mask: Boolean mask of the same shape.
    """
    return (values * mask).sum(axis=0) / (mask.sum(axis=0, dtype=values.dtype) + 1e-30)


def mean_places(values: Array) -> Array:
    """Return the place of each value along the first axis: 0 for the highest. Equal values share
    their mean place.

    Example:
        >>> mean_places(np.array([0.5, 0.9, 0.2, 0.9, 0.7]))
        array([3. , 0.5, 4. , 0.5, 2. ])
    """
    above = (values[None, ...] > values[:, None, ...]).sum(axis=1, dtype=values.dtype)
    below = (values[None, ...] < values[:, None, ...]).sum(axis=1, dtype=values.dtype)
    return (values.shape[0] - 1 + above - below) / 2


def is_compiling(array: Array) -> bool:
    """Return whether a compiler is tracing: there, arithmetic costs less than function calls and
    table look-ups.
    """
    if isinstance(array, _NUMPY):
        return False
    compiler = getattr(namespace(array), "compiler", None)  # torch has one
    return device_of(array) is None if compiler is None else bool(compiler.is_compiling())


def ones(like: Array) -> Array:
    """Return a read-only array of ones of the shape and dtype of another.

    On NumPy the array is cached. On other libraries it is a view of a single 1.
    """
    if isinstance(like, np.ndarray):
        return _ones(like.shape, like.dtype)
    xp = namespace(like)
    return xp.broadcast_to(
        xp.ones((1,) * like.ndim, dtype=like.dtype, device=device_of(like)), like.shape
    )


@lru_cache(maxsize=16)
def _ones(shape: tuple[int, ...], dtype: "np.dtype[np.generic]") -> Array:
    array = np.ones(shape, dtype)
    array.flags.writeable = False
    return array
