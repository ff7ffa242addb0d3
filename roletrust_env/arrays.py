"""What the core needs to know of the array library that its inputs come from."""

from functools import lru_cache
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np
from array_api_compat import array_namespace

Array: TypeAlias = Any
"""A NumPy array or a torch tensor. Axis 0 is the rater, axis 1 the provider, every further axis is batch."""


_NUMPY = (np.ndarray, np.generic)
_NAMESPACES: dict[type, ModuleType] = {}
"""By type of array, as far as they were asked for: a compiler can see through a look-up, but not through a cache."""


def namespace(array: Array) -> ModuleType:
    """Return the array namespace of `array`, which the same lines of code run on.

    Args:
        array: a NumPy array or scalar, or an array of any library that array-api-compat knows (torch, ...).

    Returns:
        `numpy` itself (NumPy 2 follows the standard, and a wrapper would double the time of a small game), or the
        namespace that array-api-compat gives.
    """
    if isinstance(array, _NUMPY):
        return np
    kind = type(array)
    if kind not in _NAMESPACES:
        _NAMESPACES[kind] = array_namespace(array)
    return _NAMESPACES[kind]


def library_of(like: Array) -> str:
    """Return the array library and the dtype of an array, such as `torch float32`."""
    return f"{type(like).__module__.partition('.')[0]} {str(like.dtype).rpartition('.')[2]}"


def largest(array: Array) -> Array:
    """The largest along the first axis, see `total`."""
    return np.maximum.reduce(array) if isinstance(array, np.ndarray) else namespace(array).max(array, axis=0)


def total(array: Array, axis: int) -> Array:
    """The sum along an axis: for small arrays of NumPy, what its method calls takes half the time of the method."""
    return np.add.reduce(array, axis) if isinstance(array, np.ndarray) else array.sum(axis=axis)


def copied(array: Array) -> Array:
    """A copy of an array, also for a compiler, which takes none from `asarray`."""
    return array.copy() if isinstance(array, np.ndarray) else array + 0


def cast(array: Array, dtype: Any) -> Array:
    """An array in another dtype; also a single number of NumPy, which `astype` of the standard refuses."""
    return array.astype(dtype) if isinstance(array, _NUMPY) else namespace(array).astype(array, dtype)


def mean_where(values: Array, there: Array) -> Array:
    """The mean along the first axis of the values that are there, of the same shape; 0 where none is."""
    return (values * there).sum(axis=0) / (there.sum(axis=0, dtype=values.dtype) + 1e-30)


def compiling(array: Array) -> bool:
    """Whether a compiler is looking, to which arithmetic is cheaper than calls of functions and look-ups in tables."""
    if isinstance(array, _NUMPY):
        return False
    compiler = getattr(namespace(array), "compiler", None)  # torch has one
    return compiler is not None and bool(compiler.is_compiling())


def ones(like: Array) -> Array:
    """An array of ones like another, for reading only: one that is kept for NumPy, a view of a single 1 elsewhere."""
    if isinstance(like, np.ndarray):
        return _ones(like.shape, like.dtype)
    xp = namespace(like)
    return xp.broadcast_to(xp.ones((1,) * like.ndim, dtype=like.dtype, device=like.device), like.shape)


@lru_cache(maxsize=16)
def _ones(shape: tuple[int, ...], dtype: "np.dtype[np.generic]") -> Array:
    made = np.ones(shape, dtype)
    made.flags.writeable = False
    return made
