"""The functions of the array API standard that the rules use, for recorded arrays."""

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.lib.array_utils import normalize_axis_index

from roletrust_env.arrays import Array
from roletrust_env.compiled.record import (
    Recorded,
    UnrecordableError,
    bitcast,
    broadcast,
    cast,
    concat,
    constant,
    elementwise,
    gather,
    reduce,
    view,
    where,
)


def _sum(array: Any, axis: Any = None, *, dtype: Any = None, keepdims: bool = False) -> Array:
    array = constant(array)
    if dtype is None:
        dtype = np.int64 if array.dtype.kind in "bi" else array.dtype
    return reduce(np.add, cast(array, dtype), axis, keepdims)


def _mean(array: Any, axis: Any = None, *, keepdims: bool = False) -> Array:
    array = constant(array)
    total = _sum(array, axis, keepdims=keepdims)
    return total / (array.size // max(total.size, 1))


def _stack(arrays: Sequence[Any], axis: int = 0) -> Array:
    return concat([_expand(array, axis) for array in arrays], axis)


def _expand(array: Any, axis: Any = 0) -> Array:
    return view(array, lambda positions: np.expand_dims(positions, axis))


def _clip(array: Any, low: Any = None, high: Any = None) -> Array:
    array = array if low is None else elementwise(np.maximum, array, low)
    return array if high is None else elementwise(np.minimum, array, high)


def _matmul(one: Any, other: Any) -> Array:
    one, other = constant(one), constant(other)
    if one.ndim < 2 or other.ndim < 2:
        raise UnrecordableError("a matrix product with a vector cannot be recorded")
    return _sum(one[..., :, None, :] * other.swapaxes(-1, -2)[..., None, :, :], -1)


def _einsum(subscripts: str, *arrays: Any) -> Array:
    """Return the sum of products along axes with names; `...` stands for the axes of a batch."""
    first = subscripts.partition(",")[0].replace("...", "")
    batch = "ABC"[: constant(arrays[0]).ndim - len(first)]
    *given, result = subscripts.replace("...", batch).replace("->", ",").split(",")
    names = result + "".join(sorted(set("".join(given)) - set(result)))
    factors = []
    for axes, array in zip(given, map(constant, arrays), strict=True):
        order = [axes.index(name) for name in names if name in axes]
        shape = [array.shape[axes.index(name)] if name in axes else 1 for name in names]
        factors.append(view(array, lambda p, o=order, s=shape: p.transpose(o).reshape(s)))
    return _sum(math.prod(factors), tuple(range(len(result), len(names))))


def _ranks(array: Array) -> Array:
    """Return the rank of each entry along the last axis: 0 for the least; ties in their order."""
    n = array.shape[-1]
    here, there = array[..., :, None], array[..., None, :]
    earlier = np.arange(n)[None, :] < np.arange(n)[:, None]
    return _sum((there < here) | ((there == here) & constant(earlier)), -1)


def _sorted_last(array: Array, values: Array) -> Array:
    """Return values in the order of an array along the last axis."""
    n, zero = array.shape[-1], np.zeros((), values.dtype)
    placed = _ranks(array)[..., None, :] == constant(np.arange(n)[:, None])
    return _sum(where(placed, values[..., None, :], zero), -1)


def _sort(array: Any, axis: int = -1, **options: Any) -> Array:
    rows = view(array, lambda positions: np.moveaxis(positions, axis, -1))
    return view(_sorted_last(rows, rows), lambda positions: np.moveaxis(positions, -1, axis))


def _argsort(array: Any, axis: int = -1, **options: Any) -> Array:
    array = constant(array)
    axis = normalize_axis_index(axis, array.ndim)
    if array.ranks is not None and array.ranks[0] == axis:
        return array.ranks[1]
    rows = view(array, lambda positions: np.moveaxis(positions, axis, -1))
    places = broadcast(constant(np.arange(rows.shape[-1])), rows.shape)
    order, ranks = (
        view(x, lambda positions: np.moveaxis(positions, -1, axis))
        for x in (_sorted_last(rows, places), _ranks(rows))
    )
    order.ranks = axis, ranks
    return order


def _take_along(array: Any, places: Any, axis: int = -1) -> Array:
    array, axis = constant(array), normalize_axis_index(axis, array.ndim)
    rows = [view(x, lambda p: np.moveaxis(p, axis, -1)) for x in (array, places)]
    n = rows[0].shape[-1]
    starts = np.arange(math.prod(rows[1].shape[:-1])).reshape(*rows[1].shape[:-1], 1) * n
    found = gather(rows[0].reshape(-1), rows[1] + starts)
    return view(found, lambda p: np.moveaxis(p, -1, axis))


def _solve(matrix: Any, given: Any) -> Array:
    """Return the solution of linear equations by Gauss and Jordan, with the largest pivot."""
    matrix, given = constant(matrix), constant(given)
    n = matrix.shape[-1]
    both, free = concat([matrix, given], -1), constant(np.ones(n, bool))
    order = list[Array]()
    for k in range(n):
        column = both[..., :, k]
        size = where(free, abs(column), -1.0)
        first = where(size == size.max(-1, keepdims=True), np.arange(n), n).min(-1, keepdims=True)
        pivot = constant(np.arange(n)) == first
        row = _sum(where(pivot[..., None], both, 0.0), -2)
        row = row / row[..., k : k + 1]
        both = where(
            pivot[..., None], row[..., None, :], both - column[..., None] * row[..., None, :]
        )
        free, order = free & ~pivot, [*order, pivot]
    found = [_sum(where(pivot[..., None], both[..., n:], 0.0), -2) for pivot in order]
    return _stack(found, -2)


def _views(function: Any) -> Any:
    """Return a function of the namespace that only arranges entries."""
    return lambda array, *args, **options: view(
        array, lambda positions: function(positions, *args, **options)
    )


def _makes(function: Any) -> Any:
    """Return a function of the namespace that makes a constant."""

    def make(*args: Any, dtype: Any = None, device: Any = None, **options: Any) -> Array:
        return constant(function(*args, dtype=dtype, **options))

    return make


def _makes_like(function: Any) -> Any:
    """Return a function of the namespace that makes a constant in the shape of an array."""
    return lambda array, dtype=None, device=None: constant(
        function(array.shape, dtype=array.dtype if dtype is None else dtype)
    )


def _asarray(values: Any, dtype: Any = None, device: Any = None, copy: Any = None) -> Array:
    return constant(values, dtype)


class _Namespace:
    """The functions of the array API standard that the rules use, on recorded arrays."""

    __name__ = "roletrust_env.compiled.namespace"

    def __init__(self) -> None:
        self.einsum, self.bitcast = _einsum, bitcast
        self.linalg = SimpleNamespace(solve=_solve)
        self.asarray = self.array = _asarray
        self.astype = cast
        self.where, self.sum, self.mean, self.matmul = where, _sum, _mean, _matmul
        self.concat = self.concatenate = concat
        self.stack, self.clip, self.sort, self.argsort = _stack, _clip, _sort, _argsort
        self.take_along_axis, self.broadcast_to = _take_along, broadcast
        self.max = self.amax = _reduces(np.maximum)
        self.min = self.amin = _reduces(np.minimum)
        self.any, self.all = _reduces(np.logical_or, bool), _reduces(np.logical_and, bool)
        for name in ("reshape", "swapaxes", "moveaxis", "expand_dims", "squeeze", "ravel"):
            setattr(self, name, _views(getattr(np, name)))
        for name in ("transpose", "permute_dims", "flip", "roll", "repeat", "tile", "take"):
            setattr(self, name, _views(getattr(np, name)))
        for name in ("zeros", "ones", "full", "arange", "eye", "linspace", "empty"):
            setattr(self, name, _makes(getattr(np, name)))
        for name in ("zeros", "ones", "empty"):
            setattr(
                self, f"{name}_like", _makes_like(getattr(np, "zeros" if name == "empty" else name))
            )

    def broadcast_arrays(self, *arrays: Any) -> list[Array]:
        """Return arrays in their common shape."""
        shape = np.broadcast_shapes(*(constant(array).shape for array in arrays))
        return [broadcast(array, shape) for array in arrays]

    def round(self, array: Any) -> Array:
        """Return the nearest whole numbers."""
        return elementwise(np.rint, array)

    def isnan(self, array: Any) -> Array:
        """Return whether entries are NaN."""
        return elementwise(np.not_equal, array, array)

    def isfinite(self, array: Any) -> Array:
        """Return whether entries are numbers other than infinity."""
        return elementwise(np.equal, array - array, 0)

    def __getattr__(self, name: str) -> Any:
        """Return a dtype, a constant or an elementwise function of NumPy."""
        known = getattr(np, name, None)
        if isinstance(known, np.ufunc):
            return lambda *arrays: elementwise(known, *arrays)
        if isinstance(known, type | float) or name == "newaxis":
            return known
        if name == "finfo":
            return np.finfo
        if name.startswith("_") or name == "compiler":
            raise AttributeError(name)
        raise UnrecordableError(f"there is no recorded {name}")


def _reduces(ufunc: Any, dtype: Any = None) -> Any:
    def function(array: Any, axis: Any = None, keepdims: bool = False) -> Array:
        array = constant(array)
        return reduce(ufunc, array if dtype is None else cast(array, dtype), axis, keepdims)

    return function


Recorded.namespace = _Namespace()
