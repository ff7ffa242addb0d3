"""An array library that records operations instead of computing them.

A `Recorded` array is a node of a graph: an operation, and the arrays that it is applied to. The
rules of a game run on it unchanged, as on any library of the array API standard. NumPy computes
every operation whose arrays are all constants. Equal operations are one node.
"""

import math
from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt
from numpy.lib.array_utils import normalize_axis_index, normalize_axis_tuple

from roletrust_env.compiled import functions

Shape = tuple[int, ...]
Indices = npt.NDArray[np.int32]


class UnrecordableError(ValueError):
    """An operation cannot be recorded, so the game cannot be compiled."""


class Recorded:
    """An array of a recording.

    Attributes:
        op: `"constant"`, `"input"`, `"view"`, `"concat"`, `"gather"`, `"bitcast"`, `"cast"`,
            `"where"`, the name of a reduction such as `"reduce_add"`, or the name of an elementwise
            function of NumPy. The arguments of an elementwise operation have the shape of the
            result.
        args: Arrays that the operation is applied to.
        data: The values of a constant; the name of an input; the flat positions in the argument
            that a view shows, in the shape of the view; the flat positions of each part of a
            concatenation; the number of entries of one row of the table of a gather.
        shape: Shape in one game.
        dtype: Dtype of NumPy.
    """

    __slots__ = ("__weakref__", "args", "data", "dtype", "op", "shape")

    device = None  # as of an array that JAX traces

    def __init__(
        self, op: str, args: tuple["Recorded", ...], data: Any, shape: Shape, dtype: Any
    ) -> None:
        self.op, self.args, self.data, self.shape = op, args, data, shape
        self.dtype: Any = np.dtype(dtype)

    def __repr__(self) -> str:
        return f"Recorded({self.op}, shape={self.shape}, dtype={self.dtype})"

    def __array_namespace__(self, *, api_version: str | None = None) -> Any:
        return NAMESPACE

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Record a function of NumPy that is called with a recorded array."""
        if method != "__call__" or options:
            raise UnrecordableError(f"numpy.{ufunc.__name__}.{method} cannot be recorded")
        return elementwise(ufunc, *inputs)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        return getattr(NAMESPACE, function.__name__)(*args, **options)

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        return np.asarray(self._known("a conversion to NumPy"), dtype)

    def _known(self, use: str) -> npt.NDArray[Any]:
        """Return the values of a constant; refuse any other array."""
        if self.op != "constant":
            raise UnrecordableError(f"{use} depends on values of the game")
        values: npt.NDArray[Any] = self.data
        return values

    def __bool__(self) -> bool:
        return bool(self._known("a branch"))

    def __float__(self) -> float:
        return float(self._known("float()"))

    def __int__(self) -> int:
        return int(self._known("int()"))

    def __index__(self) -> int:
        return self._known("an index of Python").__index__()

    def item(self) -> Any:
        """Return the value of a constant."""
        return self._known("item()").item()

    def tolist(self) -> Any:
        """Return the values of a constant as lists."""
        return self._known("tolist()").tolist()

    def __len__(self) -> int:
        return self.shape[0]

    def __iter__(self) -> Iterator["Recorded"]:
        return (self[place] for place in range(self.shape[0]))

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of entries."""
        return math.prod(self.shape)

    @property
    def T(self) -> "Recorded":
        """The transposed array."""
        return view(self, np.transpose)

    def __getitem__(self, key: Any) -> "Recorded":
        if isinstance(key, Recorded) and key.op != "constant":
            return _gather(self, key)
        parts = key if isinstance(key, tuple) else (key,)
        if any(isinstance(part, Recorded) and part.op != "constant" for part in parts):
            raise UnrecordableError("an index with several axes depends on values of the game")
        known = tuple(part.data if isinstance(part, Recorded) else part for part in parts)
        return view(self, lambda positions: positions[known])

    def __setitem__(self, key: Any, values: Any) -> None:
        raise UnrecordableError("an array is written to in place")

    __hash__ = object.__hash__

    def __eq__(self, other: Any) -> Any:
        return elementwise(np.equal, self, other)

    def __ne__(self, other: Any) -> Any:
        return elementwise(np.not_equal, self, other)

    def __neg__(self) -> "Recorded":
        return elementwise(np.negative, self)

    def __abs__(self) -> "Recorded":
        return elementwise(np.absolute, self)

    def __invert__(self) -> "Recorded":
        return elementwise(np.invert, self)

    def __matmul__(self, other: Any) -> "Recorded":
        return _matmul(self, other)

    def __rmatmul__(self, other: Any) -> "Recorded":
        return _matmul(other, self)

    def astype(self, dtype: Any, copy: bool = True) -> "Recorded":
        """Return the array in another dtype."""
        return cast(self, dtype)

    def reshape(self, *shape: Any) -> "Recorded":
        """Return the array in another shape."""
        return view(self, lambda positions: positions.reshape(*shape))

    def ravel(self) -> "Recorded":
        """Return the array with one axis."""
        return self.reshape(-1)

    flatten = ravel

    def swapaxes(self, one: int, other: int) -> "Recorded":
        """Return the array with two axes swapped."""
        return view(self, lambda positions: positions.swapaxes(one, other))

    def copy(self, order: str = "C") -> "Recorded":
        """Return the array itself, as nobody writes to it."""
        return self

    def clip(self, low: Any = None, high: Any = None) -> "Recorded":
        """Return the values within bounds."""
        return _clip(self, low, high)

    def sum(self, axis: Any = None, dtype: Any = None, keepdims: bool = False) -> "Recorded":
        """Return the sum along axes."""
        return _sum(self, axis, dtype=dtype, keepdims=keepdims)

    def mean(self, axis: Any = None, keepdims: bool = False) -> "Recorded":
        """Return the mean along axes."""
        return _mean(self, axis, keepdims=keepdims)

    def max(self, axis: Any = None, keepdims: bool = False) -> "Recorded":
        """Return the maximum along axes."""
        return reduce(np.maximum, self, axis, keepdims=keepdims)

    def min(self, axis: Any = None, keepdims: bool = False) -> "Recorded":
        """Return the minimum along axes."""
        return reduce(np.minimum, self, axis, keepdims=keepdims)

    def any(self, axis: Any = None, keepdims: bool = False) -> "Recorded":
        """Return whether any entry along axes is true."""
        return reduce(np.logical_or, cast(self, bool), axis, keepdims=keepdims)

    def all(self, axis: Any = None, keepdims: bool = False) -> "Recorded":
        """Return whether all entries along axes are true."""
        return reduce(np.logical_and, cast(self, bool), axis, keepdims=keepdims)


def _operator(ufunc: Any) -> tuple[Any, Any]:
    """Return the methods of a binary operator and of its reflection."""
    return (
        lambda one, other: elementwise(ufunc, one, other),
        lambda one, other: elementwise(ufunc, other, one),
    )


for _name, _ufunc in {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "truediv": np.divide,
    "floordiv": np.floor_divide,
    "mod": np.remainder,
    "pow": np.power,
    "and": np.bitwise_and,
    "or": np.bitwise_or,
    "xor": np.bitwise_xor,
    "lshift": np.left_shift,
    "rshift": np.right_shift,
}.items():
    for _prefix, _method in zip(("", "r"), _operator(_ufunc), strict=True):
        setattr(Recorded, f"__{_prefix}{_name}__", _method)
for _name, _ufunc in {
    "lt": np.less,
    "le": np.less_equal,
    "gt": np.greater,
    "ge": np.greater_equal,
}.items():
    setattr(Recorded, f"__{_name}__", _operator(_ufunc)[0])


_NODES: WeakValueDictionary[Any, Recorded] = WeakValueDictionary()
"""Every node by what it is, so that equal operations are one node."""


def _node(op: str, args: Sequence[Recorded], data: Any, shape: Shape, dtype: Any) -> Recorded:
    arrays = data if isinstance(data, tuple) else (data,)
    content = tuple(
        (part.tobytes(), part.shape) if isinstance(part, np.ndarray) else part for part in arrays
    )
    key = op, tuple(map(id, args)), content, shape, np.dtype(dtype).char
    node = _NODES.get(key)
    if node is None:
        node = _NODES[key] = Recorded(op, tuple(args), data, shape, dtype)
    return node


def constant(values: Any, dtype: Any = None) -> Recorded:
    """Return a constant; a recorded array is returned as it is, or cast."""
    if isinstance(values, Recorded):
        return values if dtype is None else cast(values, dtype)
    if isinstance(values, list | tuple) and any(isinstance(part, Recorded) for part in values):
        return _stack(values)
    array = np.ascontiguousarray(values, dtype).reshape(np.shape(values))
    return _node("constant", (), array, array.shape, array.dtype)


def make_input(name: str, shape: Shape, dtype: Any) -> Recorded:
    """Return an array whose values are known only when a round is played."""
    return _node("input", (), name, shape, dtype)


def elementwise(ufunc: Any, *inputs: Any) -> Recorded:
    """Return a function of NumPy of arrays and numbers, with the dtype that NumPy gives it."""
    kinds = [
        type(x) if isinstance(x, bool | int | float) else np.asarray(x).dtype
        if not isinstance(x, Recorded)
        else x.dtype
        for x in inputs
    ]
    kinds = [np.dtype(bool) if kind is bool else kind for kind in kinds]
    *needed, made = ufunc.resolve_dtypes((*kinds, None))
    args = [constant(x, dtype) for x, dtype in zip(inputs, needed, strict=True)]
    if all(arg.op == "constant" for arg in args):
        with np.errstate(all="ignore"):
            return constant(ufunc(*(arg.data for arg in args)))
    shape = np.broadcast_shapes(*(arg.shape for arg in args))
    args = [broadcast(arg, shape) for arg in args]
    name = _OF_FLAGS.get(ufunc.__name__, ufunc.__name__) if needed[0] == bool else ufunc.__name__
    if (simple := _simplified(name, *args)) is not None:
        return simple
    expanded = getattr(functions, name, None)
    if expanded is not None:
        result: Recorded = expanded(*args)
        return result
    if name not in _PRIMITIVE:
        raise UnrecordableError(f"there is no compiled {ufunc.__name__} of {needed[0]}")
    return _node(name, args, None, shape, made)


_OF_FLAGS = {
    "add": "bitwise_or",
    "maximum": "bitwise_or",
    "logical_or": "bitwise_or",
    "multiply": "bitwise_and",
    "minimum": "bitwise_and",
    "logical_and": "bitwise_and",
    "not_equal": "bitwise_xor",
    "logical_not": "invert",
}
"""Functions of flags that are others by another name."""

_PRIMITIVE = frozenset(
    "add subtract multiply divide negative absolute sqrt floor rint minimum maximum equal not_equal"
    " less less_equal greater greater_equal bitwise_and bitwise_or bitwise_xor invert left_shift"
    " right_shift".split()
)
"""Functions that are emitted as they are; `functions` is written with them."""


def _simplified(name: str, one: Recorded, *others: Recorded) -> Recorded | None:
    """Return the array that an operation with a constant leaves as it is; None for any other."""
    neutral = {"add": 0, "subtract": 0, "multiply": 1, "divide": 1, "bitwise_and": True}
    if not others or name not in (*neutral, "bitwise_or"):
        return None
    (other,) = others
    if one.op == "constant" and name not in ("subtract", "divide"):
        one, other = other, one
    value = _uniform(other)
    if value is None or (name.startswith("bitwise") and one.dtype != bool):
        return None
    if name == "bitwise_or":
        return other if value else one
    if name == "bitwise_and" and not value:
        return other
    return one if value == neutral[name] else None


def _uniform(array: Recorded) -> Any:
    """Return the number that all entries of a constant are equal to; None if there is none."""
    if array.op != "constant" or not array.size:
        return None
    first = array.data.flat[0]
    return first if (array.data == first).all() else None


def cast(array: Recorded, dtype: Any) -> Recorded:
    """Return an array in another dtype."""
    if array.dtype == dtype:
        return array
    if array.op == "constant":
        return constant(array.data.astype(dtype))
    if dtype == bool:
        return elementwise(np.not_equal, array, 0)
    return _node("cast", (array,), None, array.shape, dtype)


def bitcast(array: Recorded, dtype: Any) -> Recorded:
    """Return the bits of numbers as numbers of another dtype of the same size."""
    return _node("bitcast", (array,), None, array.shape, dtype)


def view(array: Any, arrange: Any) -> Recorded:
    """Return an array whose entries are those of another, in another order or shape.

    Args:
        array: Array.
        arrange: Function of NumPy that does the same with an array of the same shape.
    """
    array = constant(array)
    if array.op == "constant":
        return constant(arrange(array.data))
    positions = np.arange(array.size, dtype=np.int32).reshape(array.shape)
    shown = np.ascontiguousarray(arrange(positions)).reshape(np.shape(arrange(positions)))
    if array.op == "view":
        array, shown = array.args[0], array.data.reshape(-1)[shown]
    if shown.shape == array.shape and (shown.reshape(-1) == np.arange(array.size)).all():
        return array
    return _node("view", (array,), shown.astype(np.int32), shown.shape, array.dtype)


def broadcast(array: Any, shape: Any) -> Recorded:
    """Return an array in a shape that it broadcasts to."""
    array, shape = constant(array), tuple(shape)
    if array.shape == shape:
        return array
    return view(array, lambda positions: np.broadcast_to(positions, shape))


def where(condition: Any, yes: Any, no: Any) -> Recorded:
    """Return entries of one array where a condition holds, and of another elsewhere."""
    condition = cast(constant(condition), bool)
    kinds = [x.dtype if isinstance(x, Recorded) else x for x in (yes, no)]
    dtype = np.result_type(*kinds)
    yes, no = constant(yes, dtype), constant(no, dtype)
    shape = np.broadcast_shapes(condition.shape, yes.shape, no.shape)
    args = [broadcast(x, shape) for x in (condition, yes, no)]
    chosen = _uniform(condition)
    if chosen is not None:
        return args[1] if chosen else args[2]
    if args[1] is args[2]:
        return args[1]
    if all(arg.op == "constant" for arg in args):
        return constant(np.where(*(arg.data for arg in args)))
    if dtype == bool:
        return (args[0] & args[1]) | (~args[0] & args[2])
    return _node("where", args, None, shape, dtype)


def reduce(ufunc: Any, array: Any, axis: Any = None, keepdims: bool = False) -> Recorded:
    """Return the reduction of an array along one axis, several, or all."""
    array = constant(array)
    axes = range(array.ndim) if axis is None else normalize_axis_tuple(axis, array.ndim)
    if keepdims:
        shape = [1 if k in axes else n for k, n in enumerate(array.shape)]
        return reduce(ufunc, array, axis).reshape(shape)
    if array.op == "constant":
        return constant(ufunc.reduce(array.data, tuple(axes)))
    others = [k for k in range(array.ndim) if k not in axes]
    outer = tuple(array.shape[k] for k in others)
    rows = view(array, lambda positions: positions.transpose(*others, *axes).reshape(*outer, -1))
    if rows.shape[-1] == 0:
        raise UnrecordableError("a reduction is of no entries")
    if rows.shape[-1] == 1:
        return rows[..., 0]
    name = _OF_FLAGS[ufunc.__name__] if array.dtype == bool else ufunc.__name__
    return _node(f"reduce_{name}", (rows,), None, outer, array.dtype)


def _sum(array: Any, axis: Any = None, *, dtype: Any = None, keepdims: bool = False) -> Recorded:
    array = constant(array)
    if dtype is None:
        dtype = np.int64 if array.dtype.kind in "bi" else array.dtype
    return reduce(np.add, cast(array, dtype), axis, keepdims)


def _mean(array: Any, axis: Any = None, *, keepdims: bool = False) -> Recorded:
    array = constant(array)
    total = _sum(array, axis, keepdims=keepdims)
    result: Recorded = total / (array.size // max(total.size, 1))
    return result


def _gather(table: Recorded, places: Recorded) -> Recorded:
    """Return rows of a table at places along its first axis."""
    rows = math.prod(table.shape[1:])
    shape = (*places.shape, *table.shape[1:])
    at = broadcast(places.reshape(*places.shape, *[1] * (table.ndim - 1)), shape)
    within = np.broadcast_to(np.arange(rows).reshape(table.shape[1:]), shape)
    flat = cast(at, np.int64) * rows + within
    return _node("gather", (table, flat), None, shape, table.dtype)


def _concat(arrays: Sequence[Any], axis: int = 0) -> Recorded:
    parts = [constant(array) for array in arrays]
    dtype = np.result_type(*(part.dtype for part in parts))
    parts = [cast(part, dtype) for part in parts if part.size or len(parts) == 1]
    if len(parts) == 1:
        return parts[0]
    if all(part.op == "constant" for part in parts):
        return constant(np.concatenate([part.data for part in parts], axis))
    shape = np.concatenate([np.empty(part.shape, bool) for part in parts], axis).shape
    positions = np.arange(math.prod(shape), dtype=np.int32).reshape(shape)
    ends = np.cumsum([part.shape[axis] for part in parts])[:-1]
    pieces = tuple(np.ascontiguousarray(p) for p in np.split(positions, ends, axis))
    return _node("concat", parts, pieces, shape, dtype)


def _stack(arrays: Sequence[Any], axis: int = 0) -> Recorded:
    return _concat([_expand(array, axis) for array in arrays], axis)


def _expand(array: Any, axis: Any = 0) -> Recorded:
    return view(array, lambda positions: np.expand_dims(positions, axis))


def _clip(array: Any, low: Any = None, high: Any = None) -> Recorded:
    array = array if low is None else elementwise(np.maximum, array, low)
    return array if high is None else elementwise(np.minimum, array, high)


def _matmul(one: Any, other: Any) -> Recorded:
    one, other = constant(one), constant(other)
    if one.ndim < 2 or other.ndim < 2:
        raise UnrecordableError("a matrix product with a vector cannot be recorded")
    return _sum(one[..., :, None, :] * other.swapaxes(-1, -2)[..., None, :, :], -1)


def _first(array: Any, shape: Any) -> Any:
    """Return the arguments of a function of the form `f(array, *arguments)` of NumPy."""
    return constant(array), shape


def _ranks(array: Recorded) -> Recorded:
    """Return the rank of each entry along the last axis: 0 for the least; ties in their order."""
    n = array.shape[-1]
    here, there = array[..., :, None], array[..., None, :]
    earlier = np.arange(n)[None, :] < np.arange(n)[:, None]
    return _sum((there < here) | ((there == here) & constant(earlier)), -1)


def _sorted_last(array: Recorded, values: Recorded) -> Recorded:
    """Return values in the order of an array along the last axis."""
    n, zero = array.shape[-1], np.zeros((), values.dtype)
    placed = _ranks(array)[..., None, :] == constant(np.arange(n)[:, None])
    return _sum(where(placed, values[..., None, :], zero), -1)


def _sort(array: Any, axis: int = -1, **options: Any) -> Recorded:
    rows = view(array, lambda positions: np.moveaxis(positions, axis, -1))
    return view(_sorted_last(rows, rows), lambda positions: np.moveaxis(positions, -1, axis))


def _argsort(array: Any, axis: int = -1, **options: Any) -> Recorded:
    rows = view(array, lambda positions: np.moveaxis(positions, axis, -1))
    places = broadcast(constant(np.arange(rows.shape[-1])), rows.shape)
    return view(_sorted_last(rows, places), lambda positions: np.moveaxis(positions, -1, axis))


def _take_along(array: Any, places: Any, axis: int = -1) -> Recorded:
    array, axis = constant(array), normalize_axis_index(axis, array.ndim)
    rows = [view(x, lambda p: np.moveaxis(p, axis, -1)) for x in (array, places)]
    n = rows[0].shape[-1]
    starts = np.arange(math.prod(rows[1].shape[:-1])).reshape(*rows[1].shape[:-1], 1) * n
    found = _gather(rows[0].reshape(-1), rows[1] + starts)
    return view(found, lambda p: np.moveaxis(p, -1, axis))


def _solve(matrix: Any, given: Any) -> Recorded:
    """Return the solution of linear equations by Gauss and Jordan, with the largest pivot."""
    matrix, given = constant(matrix), constant(given)
    n = matrix.shape[-1]
    both, free, order = _concat([matrix, given], -1), constant(np.ones(n, bool)), []
    for k in range(n):
        column = both[..., :, k]
        size = where(free, abs(column), -1.0)
        first = where(size == size.max(-1, keepdims=True), np.arange(n), n).min(-1, keepdims=True)
        pivot = constant(np.arange(n)) == first
        row = _sum(where(pivot[..., None], both, 0.0), -2)
        row = row / row[..., k : k + 1]
        both = where(pivot[..., None], row[..., None, :], both - column[..., None] * row[..., None, :])
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

    def make(*args: Any, dtype: Any = None, device: Any = None, **options: Any) -> Recorded:
        return constant(function(*args, dtype=dtype, **options))

    return make


def _makes_like(function: Any) -> Any:
    """Return a function of the namespace that makes a constant in the shape of an array."""
    return lambda array, dtype=None, device=None: constant(
        function(array.shape, dtype=array.dtype if dtype is None else dtype)
    )


def _asarray(values: Any, dtype: Any = None, device: Any = None, copy: Any = None) -> Recorded:
    return constant(values, dtype)


class _Namespace:
    """The functions of the array API standard that the rules use, on recorded arrays."""

    __name__ = "roletrust_env.compiled.record"

    def __init__(self) -> None:
        self.linalg = SimpleNamespace(solve=_solve)
        self.asarray = self.array = _asarray
        self.astype = cast
        self.where, self.sum, self.mean, self.matmul = where, _sum, _mean, _matmul
        self.concat = self.concatenate = _concat
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
            setattr(self, f"{name}_like", _makes_like(getattr(np, "zeros" if name == "empty" else name)))

    def broadcast_arrays(self, *arrays: Any) -> list[Recorded]:
        """Return arrays in their common shape."""
        shape = np.broadcast_shapes(*(np.shape(array) for array in arrays))
        return [broadcast(array, shape) for array in arrays]

    def isnan(self, array: Any) -> Recorded:
        """Return whether entries are NaN."""
        return elementwise(np.not_equal, array, array)

    def isfinite(self, array: Any) -> Recorded:
        """Return whether entries are numbers other than infinity."""
        return elementwise(np.equal, array - array, 0)

    def __getattr__(self, name: str) -> Any:
        """Return a dtype, a constant or an elementwise function of NumPy."""
        known = getattr(np, name, None)
        if isinstance(known, np.ufunc):
            return lambda *arrays: elementwise(known, *arrays)
        if isinstance(known, type | float) or known is None and name == "newaxis":
            return known
        if name == "finfo":
            return np.finfo
        if name.startswith("_") or name == "compiler":
            raise AttributeError(name)
        raise UnrecordableError(f"there is no recorded {name}")


def _reduces(ufunc: Any, dtype: Any = None) -> Any:
    def function(array: Any, axis: Any = None, keepdims: bool = False) -> Recorded:
        array = constant(array)
        return reduce(ufunc, array if dtype is None else cast(array, dtype), axis, keepdims)

    return function


NAMESPACE = _Namespace()
