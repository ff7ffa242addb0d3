"""An array library that records operations instead of computing them.

A `Recorded` array is a node of a graph: an operation, and the arrays that it is applied to. The
rules of a game run on it unchanged, as on any library of the array API standard. NumPy computes
every operation whose arrays are all constants. Equal operations are one node.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, ClassVar
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt
from numpy.lib.array_utils import normalize_axis_tuple
from numpy.lib.mixins import NDArrayOperatorsMixin

from roletrust_env.arrays import Array
from roletrust_env.compiled.functions import EXPANDED

Shape = tuple[int, ...]

INSTRUCTIONS = {
    "f": {
        "add": "fadd contract",
        "subtract": "fsub contract",
        "multiply": "fmul contract",
        "divide": "fdiv contract",
        "sqrt": "llvm.sqrt",
        "absolute": "llvm.fabs",
        "floor": "llvm.floor",
        "rint": "llvm.rint",
        "minimum": "llvm.minimum",
        "maximum": "llvm.maximum",
        "less": "fcmp olt",
        "less_equal": "fcmp ole",
        "greater": "fcmp ogt",
        "greater_equal": "fcmp oge",
        "equal": "fcmp oeq",
        "not_equal": "fcmp une",
    },
    "i": {
        "add": "add",
        "subtract": "sub",
        "multiply": "mul",
        "minimum": "llvm.smin",
        "maximum": "llvm.smax",
        "bitwise_and": "and",
        "bitwise_or": "or",
        "bitwise_xor": "xor",
        "left_shift": "shl",
        "right_shift": "ashr",
        "less": "icmp slt",
        "less_equal": "icmp sle",
        "greater": "icmp sgt",
        "greater_equal": "icmp sge",
        "equal": "icmp eq",
        "not_equal": "icmp ne",
    },
    "b": {
        **dict.fromkeys(["add", "maximum", "logical_or", "bitwise_or"], "or"),
        **dict.fromkeys(["multiply", "minimum", "logical_and", "bitwise_and"], "and"),
        **dict.fromkeys(["not_equal", "logical_xor", "bitwise_xor"], "xor"),
        "equal": "icmp eq",
    },
}
"""The instruction of LLVM for each elementwise function, for floats, whole numbers and flags."""


class UnrecordableError(ValueError):
    """An operation cannot be recorded, so the game cannot be compiled."""


class Recorded(NDArrayOperatorsMixin):
    """An array of a recording. The functions of its namespace are also its methods.

    Attributes:
        op: `"constant"`, `"input"`, `"key"` (an input that all games share), `"game"` (the index of
            the game in its batch), `"view"`, `"concat"`, `"gather"`, `"bitcast"`, `"cast"`,
            `"where"`, the name of a reduction such as `"reduce_add"`, or the name of an elementwise
            function of NumPy. The arguments of an elementwise operation have the shape of the
            result.
        args: Arrays that the operation is applied to.
        data: The values of a constant; the name of an input; the flat positions in the argument
            that a view shows, in the shape of the view; the axis of a concatenation.
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

    def __getattr__(self, name: str) -> Any:
        return partial(Recorded.namespace.method(name), self)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Record a function of NumPy that is called with a recorded array."""
        if "out" in options:
            raise UnrecordableError("an array is written to in place")
        if method != "__call__" or options:
            raise UnrecordableError(f"numpy.{ufunc.__name__}.{method} cannot be recorded")
        return getattr(Recorded.namespace, ufunc.__name__)(*inputs)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        return getattr(Recorded.namespace, function.__name__)(*args, **options)

    def _known(self, use: str) -> npt.NDArray[Any]:
        """Return the values of a constant; refuse any other array."""
        if self.op != "constant":
            raise UnrecordableError(f"{use} depends on values of the game")
        values: npt.NDArray[Any] = self.data
        return values

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        return np.asarray(self._known("a conversion to NumPy"), dtype)

    def __bool__(self) -> bool:
        return bool(self._known("a branch"))

    def __len__(self) -> int:
        return self.shape[0]

    __hash__ = object.__hash__

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of entries."""
        return math.prod(self.shape)

    def __getitem__(self, key: Any) -> Array:
        if isinstance(key, Recorded) and key.op != "constant" and key.dtype.kind == "i":
            return gather(self, key)
        parts = key if isinstance(key, tuple) else (key,)
        known = tuple(
            part._known("a selection") if isinstance(part, Recorded) else part for part in parts
        )
        return view(self, lambda positions: positions[known])

    def __setitem__(self, key: Any, values: Any) -> None:
        raise UnrecordableError("an array is written to in place")


_NODES: WeakValueDictionary[Any, Recorded] = WeakValueDictionary()
"""Every node by what it is, so that equal operations are one node."""


def _node(op: str, args: Sequence[Any], data: Any, shape: Shape, dtype: Any) -> Recorded:
    content = data.tobytes() if isinstance(data, np.ndarray) else data
    key = op, tuple(map(id, args)), content, shape, np.dtype(dtype).char
    node = _NODES.get(key)
    if node is None:
        node = _NODES[key] = Recorded(op, tuple(args), data, shape, dtype)
    return node


def constant(values: Any, dtype: Any = None) -> Array:
    """Return a constant; a recorded array is returned as it is, or cast."""
    if isinstance(values, Recorded):
        return values if dtype is None else to_dtype(values, dtype)
    if isinstance(values, list | tuple) and any(isinstance(part, Recorded) for part in values):
        return Recorded.namespace.stack(values)
    array = np.array(values, dtype, order="C")
    return _node("constant", (), array, array.shape, array.dtype)


def make_input(op: str, name: str, shape: Shape, dtype: Any) -> Array:
    """Return an array whose values are known only when a round is played."""
    return _node(op, (), name, shape, dtype)


def _computed(function: Callable[..., Any], args: Sequence[Recorded]) -> Array:
    """Return a function of arrays that are all constants; None for others."""
    if any(arg.op != "constant" for arg in args):
        return None
    with np.errstate(all="ignore"):
        return constant(function(*(arg.data for arg in args)))


def elementwise(ufunc: Any, *inputs: Any) -> Array:
    """Return a function of NumPy of arrays and numbers, with the dtype that NumPy gives it."""
    kinds = [type(x) if type(x) in (int, float) else constant(x).dtype for x in inputs]
    *needed, made = ufunc.resolve_dtypes((*kinds, None))
    args = [constant(x, dtype) for x, dtype in zip(inputs, needed, strict=True)]
    if (known := _computed(ufunc, args)) is not None:
        return known
    shape = np.broadcast_shapes(*(arg.shape for arg in args))
    args = [broadcast(arg, shape) for arg in args]
    name, kind = ufunc.__name__, needed[0].kind
    if name in EXPANDED:
        return EXPANDED[name](*args)
    if name not in INSTRUCTIONS.get(kind, ()):
        raise UnrecordableError(f"there is no compiled {name} of {needed[0]}")
    return _node(name, args, None, shape, made)


def to_dtype(array: Any, dtype: Any) -> Array:
    """Return an array in another dtype."""
    array = constant(array)
    if array.dtype == dtype:
        return array
    if array.op == "constant":
        return constant(array.data, dtype)
    if np.dtype(dtype).kind == "b":
        return elementwise(np.not_equal, array, 0)
    return _node("cast", (array,), None, array.shape, dtype)


def bitcast(array: Recorded, dtype: Any) -> Array:
    """Return the bits of numbers as numbers of another dtype of the same size."""
    return _node("bitcast", (array,), None, array.shape, dtype)


def view(array: Any, arrange: Callable[[Any], Any]) -> Array:
    """Return an array whose entries are those of another, in another order or shape.

    Args:
        array: Array.
        arrange: Function of NumPy that does the same with an array of the same shape.
    """
    array = constant(array)
    if array.op == "constant":
        return constant(arrange(array.data))
    positions = np.arange(array.size, dtype=np.int32)
    shown = np.asarray(arrange(positions.reshape(array.shape)))
    if array.op == "view":
        array, shown = array.args[0], array.data.reshape(-1)[shown]
    if shown.shape == array.shape and np.array_equal(shown.reshape(-1), np.arange(array.size)):
        return array
    return _node("view", (array,), shown, shown.shape, array.dtype)


def broadcast(array: Any, shape: Any) -> Array:
    """Return an array in a shape that it broadcasts to."""
    return view(array, lambda positions: np.broadcast_to(positions, shape))


def where(condition: Any, yes: Any, no: Any) -> Array:
    """Return entries of one array where a condition holds, and of another elsewhere."""
    kinds = [x.dtype if isinstance(x, Recorded) else x for x in (yes, no)]
    dtype = np.result_type(*kinds)
    args = [to_dtype(condition, bool), constant(yes, dtype), constant(no, dtype)]
    if (known := _computed(np.where, args)) is not None:
        return known
    shape = np.broadcast_shapes(*(arg.shape for arg in args))
    return _node("where", [broadcast(arg, shape) for arg in args], None, shape, dtype)


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
    return _node(f"reduce_{ufunc.__name__}", (rows,), None, outer, array.dtype)


def gather(table: Array, places: Array) -> Array:
    """Return rows of a table at places along its first axis; those outside are the last row."""
    rows, length = math.prod(table.shape[1:]), table.shape[0]
    at = to_dtype(places, np.int64).reshape((*places.shape, *[1] * (table.ndim - 1)))
    at = where(at < 0, at + length, at).clip(0, length - 1)
    at = at * rows + np.arange(rows).reshape(table.shape[1:])
    return _node("gather", (concat([table]), at), None, at.shape, table.dtype)


def concat(arrays: Sequence[Any], axis: int = 0) -> Array:
    """Return arrays one after the other along an axis; they lie together in memory."""
    parts = [constant(array) for array in arrays]
    dtype = np.result_type(*(part.dtype for part in parts))
    parts = [to_dtype(part, dtype) for part in parts]
    if (known := _computed(lambda *values: np.concatenate(values, axis), parts)) is not None:
        return known
    shape = np.concatenate([np.empty(part.shape, bool) for part in parts], axis).shape
    return _node("concat", parts, axis, shape, dtype)
