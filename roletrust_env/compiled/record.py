"""An array library that records operations instead of computing them.

A `Recorded` array is a node of a graph: an operation, and the arrays that it is applied to. The
rules of a game run on it unchanged, as on any library of the array API standard. NumPy computes
every operation whose arrays are all constants. Equal operations are one node.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt
from numpy.lib.array_utils import normalize_axis_tuple

from roletrust_env.arrays import Array
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
        ranks: Of what `argsort` returned, the axis and the rank of each entry.
    """

    __slots__ = ("__weakref__", "args", "data", "dtype", "op", "ranks", "shape")

    device = None  # as of an array that JAX traces
    namespace: ClassVar[Any]  # set by the module of this name, which is written with these arrays

    def __init__(
        self, op: str, args: tuple["Recorded", ...], data: Any, shape: Shape, dtype: Any
    ) -> None:
        self.op, self.args, self.data, self.shape = op, args, data, shape
        self.dtype: Any = np.dtype(dtype)
        self.ranks: tuple[int, Recorded] | None = None

    def __repr__(self) -> str:
        return f"Recorded({self.op}, shape={self.shape}, dtype={self.dtype})"

    def __array_namespace__(self, *, api_version: str | None = None) -> Any:
        return Recorded.namespace

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Record a function of NumPy that is called with a recorded array."""
        if method != "__call__" or options:
            raise UnrecordableError(f"numpy.{ufunc.__name__}.{method} cannot be recorded")
        return elementwise(ufunc, *inputs)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        return getattr(Recorded.namespace, function.__name__)(*args, **options)

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
    def T(self) -> Array:  # noqa: N802 - as NumPy has it
        """The transposed array."""
        return view(self, np.transpose)

    def __getitem__(self, key: Any) -> Array:
        if isinstance(key, Recorded) and key.op != "constant" and key.dtype.kind == "i":
            return gather(self, key)
        parts = key if isinstance(key, tuple) else (key,)
        if any(isinstance(part, Recorded) and part.op != "constant" for part in parts):
            raise UnrecordableError("a selection depends on values of the game")
        known = tuple(part.data if isinstance(part, Recorded) else part for part in parts)
        return view(self, lambda positions: positions[known])

    def __setitem__(self, key: Any, values: Any) -> None:
        raise UnrecordableError("an array is written to in place")

    __hash__ = object.__hash__

    def __eq__(self, other: Any) -> Any:
        return elementwise(np.equal, self, other)

    def __ne__(self, other: Any) -> Any:
        return elementwise(np.not_equal, self, other)

    def __neg__(self) -> Array:
        return elementwise(np.negative, self)

    def __abs__(self) -> Array:
        return elementwise(np.absolute, self)

    def __invert__(self) -> Array:
        return elementwise(np.invert, self)

    def __matmul__(self, other: Any) -> Array:
        return Recorded.namespace.matmul(self, other)

    def __rmatmul__(self, other: Any) -> Array:
        return Recorded.namespace.matmul(other, self)

    def astype(self, dtype: Any, copy: bool = True) -> Array:
        """Return the array in another dtype."""
        return cast(self, dtype)

    def reshape(self, *shape: Any) -> Array:
        """Return the array in another shape."""
        return view(
            self, lambda positions: np.reshape(positions, shape[0] if len(shape) == 1 else shape)
        )

    def ravel(self) -> Array:
        """Return the array with one axis."""
        return self.reshape(-1)

    flatten = ravel

    def swapaxes(self, one: int, other: int) -> Array:
        """Return the array with two axes swapped."""
        return view(self, lambda positions: positions.swapaxes(one, other))

    def copy(self, order: str = "C") -> Array:
        """Return the array itself, as nobody writes to it."""
        return self

    def clip(self, low: Any = None, high: Any = None) -> Array:
        """Return the values within bounds."""
        return Recorded.namespace.clip(self, low, high)

    def sum(self, axis: Any = None, dtype: Any = None, keepdims: bool = False) -> Array:
        """Return the sum along axes."""
        return Recorded.namespace.sum(self, axis, dtype=dtype, keepdims=keepdims)

    def mean(self, axis: Any = None, keepdims: bool = False) -> Array:
        """Return the mean along axes."""
        return Recorded.namespace.mean(self, axis, keepdims=keepdims)

    def max(self, axis: Any = None, keepdims: bool = False) -> Array:
        """Return the maximum along axes."""
        return reduce(np.maximum, self, axis, keepdims=keepdims)

    def min(self, axis: Any = None, keepdims: bool = False) -> Array:
        """Return the minimum along axes."""
        return reduce(np.minimum, self, axis, keepdims=keepdims)

    def any(self, axis: Any = None, keepdims: bool = False) -> Array:
        """Return whether any entry along axes is true."""
        return reduce(np.logical_or, cast(self, bool), axis, keepdims=keepdims)

    def all(self, axis: Any = None, keepdims: bool = False) -> Array:
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


def _node(op: str, args: Sequence[Any], data: Any, shape: Shape, dtype: Any) -> Recorded:
    arrays = data if isinstance(data, tuple) else (data,)
    content = tuple(
        (part.tobytes(), part.shape) if isinstance(part, np.ndarray) else part for part in arrays
    )
    key = op, tuple(map(id, args)), content, shape, np.dtype(dtype).char
    node = _NODES.get(key)
    if node is None:
        node = _NODES[key] = Recorded(op, tuple(args), data, shape, dtype)
    return node


def constant(values: Any, dtype: Any = None) -> Array:
    """Return a constant; a recorded array is returned as it is, or cast."""
    if isinstance(values, Recorded):
        return values if dtype is None else cast(values, dtype)
    if isinstance(values, list | tuple) and any(isinstance(part, Recorded) for part in values):
        return Recorded.namespace.stack(values)
    array = np.array(values, dtype, order="C")
    return _node("constant", (), array, array.shape, array.dtype)


def make_input(name: str, shape: Shape, dtype: Any) -> Array:
    """Return an array whose values are known only when a round is played."""
    return _node("input", (), name, shape, dtype)


def elementwise(ufunc: Any, *inputs: Any) -> Array:
    """Return a function of NumPy of arrays and numbers, with the dtype that NumPy gives it."""
    kinds = [
        type(x)
        if isinstance(x, bool | int | float)
        else np.asarray(x).dtype
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
    name = (
        _OF_FLAGS.get(ufunc.__name__, ufunc.__name__) if needed[0].kind == "b" else ufunc.__name__
    )
    if (simple := _simplified(name, *args)) is not None:
        return simple
    expanded = getattr(functions, name, None)
    if expanded is not None:
        return expanded(*args)
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
    [
        *("add", "subtract", "multiply", "divide", "negative", "absolute", "sqrt", "floor", "rint"),
        *("minimum", "maximum", "less", "less_equal", "greater", "greater_equal", "equal"),
        *("not_equal", "bitwise_and", "bitwise_or", "bitwise_xor", "invert", "left_shift"),
        "right_shift",
    ]
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


def cast(array: Recorded, dtype: Any) -> Array:
    """Return an array in another dtype."""
    if array.dtype == dtype:
        return array
    if array.op == "constant":
        return constant(array.data.astype(dtype))
    if np.dtype(dtype).kind == "b":
        return elementwise(np.not_equal, array, 0)
    return _node("cast", (array,), None, array.shape, dtype)


def bitcast(array: Recorded, dtype: Any) -> Array:
    """Return the bits of numbers as numbers of another dtype of the same size."""
    return _node("bitcast", (array,), None, array.shape, dtype)


def view(array: Any, arrange: Any) -> Array:
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


def broadcast(array: Any, shape: Any) -> Array:
    """Return an array in a shape that it broadcasts to."""
    array, shape = constant(array), tuple(shape)
    if array.shape == shape:
        return array
    return view(array, lambda positions: np.broadcast_to(positions, shape))


def where(condition: Any, yes: Any, no: Any) -> Array:
    """Return entries of one array where a condition holds, and of another elsewhere."""
    condition = cast(constant(condition), bool)
    kinds = [x.dtype if isinstance(x, Recorded) else x for x in (yes, no)]
    dtype = np.result_type(*kinds)
    yes, no = constant(yes, dtype), constant(no, dtype)
    shape = np.broadcast_shapes(condition.shape, yes.shape, no.shape)
    args: list[Array] = [broadcast(x, shape) for x in (condition, yes, no)]
    chosen = _uniform(condition)
    if chosen is not None:
        return args[1] if chosen else args[2]
    if args[1] is args[2]:
        return args[1]
    if all(arg.op == "constant" for arg in args):
        return constant(np.where(*(arg.data for arg in args)))
    if dtype.kind == "b":
        return (args[0] & args[1]) | (~args[0] & args[2])
    return _node("where", args, None, shape, dtype)


def reduce(ufunc: Any, array: Any, axis: Any = None, keepdims: bool = False) -> Array:
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


def gather(table: Array, places: Array) -> Array:
    """Return rows of a table at places along its first axis; those outside are the last row."""
    rows, length = math.prod(table.shape[1:]), table.shape[0]
    shape = (*places.shape, *table.shape[1:])
    at = cast(places, np.int64).reshape(*places.shape, *[1] * (table.ndim - 1))
    at = where(at < 0, at + length, at).clip(0, length - 1)
    within = np.broadcast_to(np.arange(rows).reshape(table.shape[1:]), shape)
    if table.op == "view":  # it is needed as it lies in memory
        positions = np.arange(table.size, dtype=np.int32).reshape(table.shape)
        table = _node("concat", (table,), (positions,), table.shape, table.dtype)
    return _node("gather", (table, at * rows + within), None, shape, table.dtype)


def concat(arrays: Sequence[Any], axis: int = 0) -> Array:
    """Return arrays one after the other along an axis."""
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
