"""The functions of the array API standard that the rules use, for recorded arrays."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from roletrust_env.arrays import Array
from roletrust_env.compiled.record import (
    Recorded,
    UnrecordableError,
    bitcast,
    broadcast,
    concat,
    constant,
    elementwise,
    gather,
    reduce,
    to_dtype,
    view,
    where,
)


def _sum(array: Any, axis: Any = None, *, dtype: Any = None, keepdims: bool = False) -> Array:
    array = constant(array)
    if dtype is None:
        dtype = np.int64 if array.dtype.kind in "bi" else array.dtype
    return reduce(np.add, to_dtype(array, dtype), axis, keepdims)


def _mean(array: Any, axis: Any = None, *, keepdims: bool = False) -> Array:
    array = constant(array)
    total = _sum(array, axis, keepdims=keepdims)
    return total / (array.size // max(total.size, 1))


def _any(array: Any, axis: Any = None, *, keepdims: bool = False) -> Array:
    return reduce(np.logical_or, to_dtype(array, bool), axis, keepdims)


def _all(array: Any, axis: Any = None, *, keepdims: bool = False) -> Array:
    return reduce(np.logical_and, to_dtype(array, bool), axis, keepdims)


def _stack(arrays: Sequence[Any], axis: int = 0) -> Array:
    return concat([_NAMESPACE.expand_dims(array, axis) for array in arrays], axis)


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
        factors.append(_NAMESPACE.transpose(array, order).reshape(shape))
    return _sum(math.prod(factors), tuple(range(len(result), len(names))))


def _ranks(array: Array) -> Array:
    """Return the rank of each entry along the last axis: 0 for the least; ties in their order."""
    places = np.arange(array.shape[-1])
    here, there = array[..., :, None], array[..., None, :]
    earlier = places < places[:, None]
    before = (there < here) | ((there == here) & earlier)
    if array.dtype.kind == "f":  # NaN comes last
        nothing = here != here
        before = before | (nothing & ((there == there) | earlier))
    return _sum(before, -1)


def _placed(values: Array, ranks: Array) -> Array:
    """Return values at their ranks along the last axis."""
    chosen = ranks[..., None, :] == np.arange(ranks.shape[-1])[:, None]
    return _sum(where(chosen, values[..., None, :], np.zeros((), values.dtype)), -1)


def _sort(array: Any, axis: int = -1, **options: Any) -> Array:
    rows = _NAMESPACE.moveaxis(array, axis, -1)
    return _NAMESPACE.moveaxis(_placed(rows, _ranks(rows)), -1, axis)


def _argsort(array: Any, axis: int = -1, **options: Any) -> Array:
    array = constant(array)
    if array.ranks is not None and array.ranks[0] == axis:
        return array.ranks[1]
    rows = _NAMESPACE.moveaxis(array, axis, -1)
    ranks = _ranks(rows)
    order = _placed(broadcast(np.arange(rows.shape[-1]), rows.shape), ranks)
    order = _NAMESPACE.moveaxis(order, -1, axis)
    order.ranks = axis, _NAMESPACE.moveaxis(ranks, -1, axis)
    return order


def _take_along(array: Any, places: Any, axis: int = -1) -> Array:
    rows, at = (_NAMESPACE.moveaxis(x, axis, -1) for x in (array, places))
    starts = np.arange(0, rows.size, rows.shape[-1]).reshape(*rows.shape[:-1], 1)
    return _NAMESPACE.moveaxis(gather(rows.reshape(-1), at + starts), -1, axis)


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
    return lambda *args, device=None, **options: constant(function(*args, **options))


def _makes_like(function: Any) -> Any:
    """Return a function of the namespace that makes a constant in the shape of an array."""
    return lambda array, dtype=None, device=None: constant(
        function(array.shape, dtype or array.dtype)
    )


_METHODS: dict[str, Callable[..., Any]] = {
    "sum": _sum,
    "mean": _mean,
    "any": _any,
    "all": _all,
    "clip": _clip,
    "max": partial(reduce, np.maximum),
    "min": partial(reduce, np.minimum),
    "astype": lambda array, dtype, copy=True: to_dtype(array, dtype),
    "reshape": lambda array, *shape: view(array, lambda positions: positions.reshape(*shape)),
    "copy": lambda array: array,
    "swapaxes": _views(np.swapaxes),
    "ravel": _views(np.ravel),
}
"""Functions that are also methods of arrays."""


class _Namespace(SimpleNamespace):
    """The functions of the array API standard that the rules use, on recorded arrays."""

    __name__ = "roletrust_env.compiled.namespace"

    def method(self, name: str) -> Callable[..., Any]:
        """Return a method of arrays."""
        if name not in _METHODS:
            raise AttributeError(f"arrays of the compiled engine have no {name}")
        return _METHODS[name]

    def __getattr__(self, name: str) -> Any:
        """Return a dtype, a constant or an elementwise function of NumPy."""
        known = getattr(np, name, None)
        if isinstance(known, np.ufunc):
            return partial(elementwise, known)
        if isinstance(known, type | float):
            return known
        if name.startswith("_") or name == "compiler":
            raise AttributeError(name)
        raise UnrecordableError(f"there is no recorded {name}")


_NAMESPACE: Any = _Namespace(
    **_METHODS,
    where=where,
    einsum=_einsum,
    bitcast=bitcast,
    matmul=_matmul,
    concat=concat,
    concatenate=concat,
    stack=_stack,
    sort=_sort,
    argsort=_argsort,
    take_along_axis=_take_along,
    broadcast_to=broadcast,
    moveaxis=_views(np.moveaxis),
    expand_dims=_views(np.expand_dims),
    transpose=_views(np.transpose),
    permute_dims=_views(np.transpose),
    linalg=SimpleNamespace(solve=_solve),
    finfo=np.finfo,
    round=partial(elementwise, np.rint),
    asarray=lambda values, dtype=None, device=None, copy=None: constant(values, dtype),
    zeros=_makes(np.zeros),
    ones=_makes(np.ones),
    full=_makes(np.full),
    arange=_makes(np.arange),
    eye=_makes(np.eye),
    zeros_like=_makes_like(np.zeros),
    ones_like=_makes_like(np.ones),
    empty_like=_makes_like(np.zeros),
)
Recorded.namespace = _NAMESPACE
