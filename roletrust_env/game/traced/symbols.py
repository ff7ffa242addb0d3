"""Symbols in place of numbers: the rules of a game run on them once, and each operation is written
on a tape.

`Symbols` is an array of NumPy for the rules, so they take the way that they take with numbers.
Beside the symbols it has an example, an array of numbers on which NumPy plays the same operations.
From the example come the dtype, the shape, the layout in memory, by which NumPy orders its sums,
and the value of all that does not depend on a symbol.
"""

from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

import numpy as np

from roletrust_env.arrays import Array
from roletrust_env.game.traced.tape import Element, Symbol, Tape, Untraceable

_TEMPLATES = {
    "add": "({} + {})",
    "subtract": "({} - {})",
    "multiply": "({} * {})",
    "divide": "({} / {})",
    "floor_divide": "({} // {})",
    "remainder": "({} % {})",
    "negative": "(-{})",
    "positive": "{}",
    "absolute": "abs({})",
    "square": "({0} * {0})",
    "sqrt": "sqrt({})",
    "sin": "sin({})",
    "less": "({} < {})",
    "less_equal": "({} <= {})",
    "greater": "({} > {})",
    "greater_equal": "({} >= {})",
    "equal": "({} == {})",
    "not_equal": "({} != {})",
    "isnan": "({0} != {0})",
    "logical_not": "(not {})",
    "logical_and": "({} and {})",
    "logical_or": "({} or {})",
    "maximum": "({0} if {0} > {1} else {1})",  # of 0.0 and -0.0 the second, as NumPy has it
    "minimum": "({0} if {0} < {1} else {1})",
}
"""Functions of NumPy that Python computes to the same bit."""

_IN_C = {
    **{name: f"{name}({{}})" for name in ("cos", "exp", "log", "log1p", "expm1")},
    "power": "pow({}, {})",
    "right_shift": "({} >> {})",
    "bitwise_xor": "({} ^ {})",
}
"""Further functions on a tape for C, whose last bit may differ from NumPy's, and those of words."""

_OF_FLAGS = {
    "bitwise_and": "logical_and",
    "bitwise_or": "logical_or",
    "bitwise_xor": "not_equal",
    "invert": "logical_not",
    "multiply": "logical_and",
    "add": "logical_or",
}
"""What functions do whose arguments are all flags."""

_NEUTRAL = {
    ("multiply", 0): 1.0,
    ("multiply", 1): 1.0,
    ("divide", 1): 1.0,
    ("subtract", 1): 0.0,
    ("logical_and", 0): True,
    ("logical_and", 1): True,
    ("logical_or", 0): False,
    ("logical_or", 1): False,
}
"""Constant that leaves the other argument as it is, by function and place; adding 0.0 changes
-0.0."""

_DECIDES = {"logical_and": False, "logical_or": True}
"""Flag that is the result, whatever the other argument is."""

_CASTS = {
    **{"bf": "(1.0 if {} else 0.0)", "if": "float({})", "bi": "int({})", "fi": "int({})"},
    **{"fb": "({} != 0)", "ib": "({} != 0)", "ui": "int({})"},
}
"""Expression that casts a number, by the kinds of the two dtypes."""


class Symbols(np.ndarray[Any, Any]):
    """An array of symbols and constants. To the rules it is an array of NumPy with the dtype of its
    example.

    Attributes:
        tape: Tape of the trace.
        example: Array of numbers, or a number, with the shape, the dtype and the layout of this
            array.
    """

    tape: Tape
    example: Array

    @staticmethod
    def of(elements: Array, example: Array, tape: Tape) -> Array:
        """Return an array of elements in the dtype of the example; the example itself if all are
        constant.
        """
        kind = example.dtype.kind
        if kind not in ("fibu" if tape.for_c else "fib"):
            raise Untraceable(f"a round has arrays of dtype {example.dtype}")
        cast = np.empty(example.shape, object)
        cast[...] = elements
        flat = cast.reshape(-1)
        flat[:] = [_cast(tape, element, kind) for element in flat]
        if not any(isinstance(element, Symbol) for element in flat):
            return example
        symbols = cast.view(Symbols)
        symbols.tape, symbols.example = tape, example
        return symbols

    @property
    def elements(self) -> Array:
        """The symbols and constants, an array of objects."""
        return super().view(np.ndarray)

    @property
    def dtype(self) -> Any:
        """The dtype of the example."""
        return self.example.dtype

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        if method == "reduce":
            return _reduced(ufunc, *inputs, **options)
        if method != "__call__" or options:
            raise Untraceable(
                f"it calls numpy.{ufunc.__name__}.{method} with "
                f"{', '.join(options) or 'no options'}"
            )
        return _applied(ufunc, inputs)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        name = function.__name__
        if name in _MOVES:
            return _moved(lambda *arrays: function(*arrays, **kwargs), *args)
        if name in _OF_THE_SHAPE:
            return function(*map(_example, args), **kwargs)
        if name == "where" and len(args) == 3:
            return _chosen(*args)
        if name in _METHODS:
            return getattr(args[0], _METHODS[name])(*args[1:], **kwargs)
        if name == "sort" and self.tape.for_c:
            return _sorted(*args, **kwargs)
        if name in _CALLS:
            return _called(lambda *arrays: function(*arrays, **kwargs), name, args)
        raise Untraceable(f"it calls numpy.{name}")

    def __getitem__(self, index: Any) -> Any:
        if any(
            isinstance(part, Symbols) for part in (index if isinstance(index, tuple) else (index,))
        ):
            raise Untraceable("an index depends on a value")
        return _moved(lambda array: np.asarray(array)[index], self)

    def __setitem__(self, index: Any, values: Any) -> None:
        raise Untraceable("it writes into an array")

    def __iter__(self) -> Any:
        return (self[k] for k in range(len(self)))

    def __bool__(self) -> bool:
        raise Untraceable("a rule branches on a value")

    def astype(self, dtype: Any, **_: Any) -> Any:  # type: ignore[override]
        """See `numpy.ndarray.astype`."""
        _refuse_single(self.tape, np.empty(0, dtype))
        return Symbols.of(self.elements, self.example.astype(dtype), self.tape)

    def view(self, dtype: Any) -> Any:  # type: ignore[override]
        """Return words as whole numbers; see `numpy.ndarray.view`."""
        return Symbols.of(self.elements, self.example.view(dtype), self.tape)

    def mean(self, axis: Any = None, **options: Any) -> Any:  # type: ignore[override]
        """See `numpy.ndarray.mean`."""
        total = self.sum(axis=axis, **options)
        return total / (self.size // max(1, np.size(total)))

    def clip(self, low: Any = None, high: Any = None) -> Any:  # type: ignore[override]
        """See `numpy.ndarray.clip`."""
        above = (
            self if low is None else np.where(self < low, low, self)
        )  # of 0.0 and -0.0 the number itself
        return above if high is None else np.where(above > high, high, above)

    def entries_of(self, table: Array) -> Any:
        """Return the entries of a table at these places, along its first axis.

        Flags at one place, such as a round, are assumed to be those of the example: masks cost much
            where they may change, and a schedule has few rows.
        """
        shape, place = table.shape[1:], self.elements.reshape(-1)[0]
        if (
            not self.tape.for_c
            and table.dtype == bool
            and self.size == 1
            and getattr(place, "name", "")
        ):
            self.tape.assumed.append((place, table))
            return table[self.example]
        columns = [tuple(column.tolist()) for column in table.reshape(len(table), -1).T]
        names = [self.tape.named("table", column) for column in columns]
        elements = np.empty((self.size, len(columns)), object)
        for row, place in zip(elements, self.elements.ravel(), strict=True):
            row[:] = [
                self.tape.write(f"{name}[{{}}]", [place], table.dtype.kind)
                if isinstance(place, Symbol)
                else column[place]
                for name, column in zip(names, columns, strict=True)
            ]
        return Symbols.of(elements.reshape((*self.shape, *shape)), table[self.example], self.tape)


def _mover(name: str) -> Callable[..., Any]:
    def method(self: Symbols, *arguments: Any, **options: Any) -> Any:
        return _moved(lambda array: getattr(np.asarray(array), name)(*arguments, **options), self)

    return method


def _reducer(ufunc: Any) -> Callable[..., Any]:
    def method(self: Symbols, axis: Any = None, **options: Any) -> Any:
        return ufunc.reduce(self, axis=axis, **options)

    return method


def _refuse(self: Symbols, *_: Any) -> Any:
    raise Untraceable("a rule takes a number out of an array")


for _name in ("reshape", "ravel", "flatten", "squeeze", "swapaxes", "transpose", "copy"):
    setattr(Symbols, _name, _mover(_name))
for _name, _ufunc in {
    **{
        "sum": np.add,
        "any": np.logical_or,
        "all": np.logical_and,
        "max": np.maximum,
        "min": np.minimum,
    }
}.items():
    setattr(Symbols, _name, _reducer(_ufunc))
for _name in ("__float__", "__int__", "__index__", "item", "tolist"):
    setattr(Symbols, _name, _refuse)


_MOVES = {
    *(
        "concatenate",
        "stack",
        "broadcast_to",
        "moveaxis",
        "swapaxes",
        "reshape",
        "expand_dims",
        "squeeze",
        "ravel",
    ),
    *("transpose", "permute_dims", "repeat", "tile", "flip", "roll", "copy"),
}
"""Functions that only move entries."""

_OF_THE_SHAPE = {
    "zeros_like",
    "ones_like",
    "empty_like",
    "full_like",
    "shape",
    "ndim",
    "size",
    "result_type",
}
"""Functions of the shape and the dtype alone."""

_METHODS = {
    **{name: name for name in ("sum", "mean", "any", "all", "max", "min", "clip", "astype")},
    **{"amax": "max", "amin": "min"},
}
"""Functions that are methods, too."""

_CALLS = {"sort", "argsort", "cumsum", "cumulative_sum", "einsum", "solve"}
"""Functions that a written round calls."""


def _example(array: Any) -> Any:
    return array.example if isinstance(array, Symbols) else array


def _objects(array: Any) -> Array:
    """Return the elements of an array, or of a number, as an array of objects."""
    return array.elements if isinstance(array, Symbols) else np.asarray(array).astype(object)


def _tape_of(*arrays: Any) -> Tape:
    return next(one.tape for one in arrays if isinstance(one, Symbols))


def _refuse_single(tape: Tape, *arrays: Any) -> None:
    """Refuse to compute in single precision, which Python does not have."""
    if not tape.for_c and any(getattr(array, "dtype", None) == np.float32 for array in arrays):
        raise Untraceable("it computes in float32")


def _cast(tape: Tape, element: Element, kind: str) -> Element:
    """Return an element in another kind of dtype."""
    if not isinstance(element, Symbol):
        return {"f": float, "i": int, "u": int, "b": bool}[kind](element)
    if element.kind == kind:
        return element
    return tape.write(_CASTS[element.kind + kind], [element], kind)


def _operate(tape: Tape, name: str, arguments: Sequence[Element], kind: str) -> Element:
    """Return the element of an operation, at least one of whose arguments is a symbol."""
    for place, constant in enumerate(arguments if len(arguments) == 2 else ()):
        other = arguments[1 - place]
        if not isinstance(other, Symbol) or isinstance(constant, Symbol):
            continue
        if name in _DECIDES and constant == _DECIDES[name]:
            return _DECIDES[name]
        neutral = _NEUTRAL.get((name, place))
        if (
            neutral is not None
            and constant == neutral
            and other.kind == kind
            and str(constant)[0] != "-"
        ):
            return other
    return tape.write(_TEMPLATES.get(name) or _IN_C[name], arguments, kind)


def _applied(ufunc: Any, inputs: Sequence[Any]) -> Any:
    """Return what a function of each entry returns."""
    tape, name, examples = _tape_of(*inputs), ufunc.__name__, [_example(one) for one in inputs]
    _refuse_single(tape, *examples)
    with np.errstate(all="ignore"):
        example = examples[0] ** examples[1] if name == "power" else ufunc(*examples)
    if (
        name == "power" and np.ndim(examples[1]) == 0
    ):  # NumPy's operator has ways of its own for some exponents
        name = {1: "positive", 2: "square", 0.5: "sqrt"}.get(float(examples[1]), name)
        inputs = inputs if name == "power" else inputs[:1]
    if all(np.asarray(one).dtype.kind == "b" for one in examples):
        name = _OF_FLAGS.get(name, name)
    if name == "matmul" and tape.for_c and all(np.ndim(one) > 1 for one in examples):
        left, right = inputs
        return (left[..., None] * right[..., None, :, :]).sum(axis=-2)
    if name not in _TEMPLATES and not (tape.for_c and name in _IN_C):
        return _called(ufunc, name, inputs)
    grids = [grid.ravel() for grid in np.broadcast_arrays(*map(_objects, inputs))]
    elements = np.empty(example.shape, object)
    kind, values = example.dtype.kind, np.asarray(example).ravel().tolist()
    elements.reshape(-1)[:] = [
        _operate(tape, name, arguments, kind)
        if any(isinstance(one, Symbol) for one in arguments)
        else value
        for value, *arguments in zip(values, *grids, strict=True)
    ]
    return Symbols.of(elements, example, tape)


def _called(function: Callable[..., Array], name: str, inputs: Sequence[Any]) -> Any:
    """Return what NumPy returns for whole arrays; the written round calls it."""
    tape, examples = _tape_of(*inputs), [_example(one) for one in inputs]
    _refuse_single(tape, *examples)
    with np.errstate(all="ignore"):
        example = function(*examples)
    if not isinstance(example, np.ndarray | np.generic):
        raise Untraceable(f"it calls numpy.{name}")
    places = [k for k, one in enumerate(inputs) if isinstance(one, Symbols)]
    molds = [np.empty_like(examples[k]) for k in places]  # of the same layout in memory

    entrywise = (
        isinstance(function, np.ufunc) and function.signature is None and len(places) == len(inputs)
    )
    same = {(one.shape, one.dtype.char) for one in (example, *(examples[k] for k in places))} == {
        (example.shape, "d")
    }

    def called(*vectors: Any) -> Array:
        if entrywise and same:  # then the layout does not matter
            return np.asarray(function(*vectors))
        arrays = list(examples)
        for k, mold, numbers in zip(places, molds, vectors, strict=True):
            arrays[k] = np.empty_like(mold)
            arrays[k][...] = np.reshape(numbers, mold.shape)
        return np.asarray(function(*arrays)).ravel()

    symbols = np.empty(example.shape, object)
    lists = [list(inputs[k].elements.ravel()) for k in places]
    symbols.reshape(-1)[:] = tape.call(called, name, lists, example.dtype.kind * example.size)
    return Symbols.of(symbols, example, tape)


def _sorted(array: Any, axis: int = -1) -> Any:
    """Return what `sort` returns, by comparing neighbours again and again: C has no other way
    without a branch.
    """
    rows = list(np.moveaxis(array, axis, 0))
    for last in range(len(rows) - 1, 0, -1):
        for k in range(last):
            rows[k : k + 2] = np.minimum(*rows[k : k + 2]), np.maximum(*rows[k : k + 2])
    return np.moveaxis(np.stack(rows), 0, axis)


def _moved(move: Callable[..., Any], *inputs: Any) -> Any:
    """Return the entries of arrays in other places; an input may be a list of arrays."""

    def each(convert: Callable[[Any], Any]) -> Any:
        def converted(one: Any) -> Any:
            if isinstance(one, list | tuple) and any(isinstance(part, Symbols) for part in one):
                return [convert(part) for part in one]
            return convert(one) if isinstance(one, np.ndarray) else one

        return move(*map(converted, inputs))

    arrays = [part for one in inputs for part in (one if isinstance(one, list | tuple) else (one,))]
    return Symbols.of(each(_objects), each(_example), _tape_of(*arrays))


def _chosen(*inputs: Any) -> Any:
    """Return what `where` returns."""
    tape, example = _tape_of(*inputs), np.where(*map(_example, inputs))
    kind = example.dtype.kind

    def chosen(flag: Element, *ways: Element) -> Element:
        one, other = (_cast(tape, way, kind) for way in ways)
        if not isinstance(flag, Symbol):
            return one if flag else other
        if one is other or (
            not isinstance(one, Symbol)
            and not isinstance(other, Symbol)
            and repr(one) == repr(other)
        ):
            return one
        return tape.write("({1} if {0} else {2})", [flag, one, other], kind)

    elements = np.empty(example.shape, object)
    grids = [grid.ravel() for grid in np.broadcast_arrays(*map(_objects, inputs))]
    elements.reshape(-1)[:] = list(map(chosen, *grids))
    return Symbols.of(elements, example, tape)


def _reduced(
    ufunc: Any,
    array: Symbols,
    axis: Any = 0,
    dtype: Any = None,
    out: Any = None,
    keepdims: bool = False,
) -> Any:
    """Return the sum, the largest or another reduction along an axis, in the order in which NumPy
    takes the entries.
    """
    tape, example, name = array.tape, array.example, ufunc.__name__
    _refuse_single(tape, example)
    result = ufunc.reduce(example, axis=axis, dtype=dtype, keepdims=keepdims)
    kind = result.dtype.kind
    if name not in _FIRST or isinstance(axis, tuple) or out is not None:
        raise Untraceable(f"it calls numpy.{name}.reduce")
    source = _objects(array if dtype is None else array.astype(dtype))
    if axis is None:
        if not example.flags.c_contiguous:
            raise Untraceable("it takes a whole array together that does not lie in order")
        source, in_a_row = source.reshape(-1), True
    else:
        source, in_a_row = np.moveaxis(source, axis, -1), _innermost(example, axis % example.ndim)

    def joined(one: Element, other: Element) -> Element:
        if isinstance(one, Symbol) or isinstance(other, Symbol):
            return _operate(tape, name, [one, other], kind)
        return ufunc(one, other).item()

    elements = np.empty(result.size, object)
    for k, row in enumerate(source.reshape(result.size, -1).tolist()):
        floats = name == "add" and kind == "f"
        elements[k] = _sum(tape, row, in_a_row) if floats else reduce(joined, [*_FIRST[name], *row])
    return Symbols.of(elements.reshape(result.shape), result, tape)


_FIRST: dict[str, list[Element]] = {
    **{"add": [0], "multiply": [], "maximum": [], "minimum": []},
    **{"logical_or": [False], "logical_and": [True]},
}
"""Functions that reduce an axis, and the number or flag that they begin with."""


def _innermost(array: Array, axis: int) -> bool:
    """Return whether NumPy walks along an axis first: whether its entries are nearest to one
    another in memory.
    """
    steps = [
        (abs(step), k)
        for k, (step, n) in enumerate(zip(array.strides, array.shape, strict=True))
        if n > 1
    ]
    return array.shape[axis] == 1 or not steps or min(steps)[1] == axis


def _sum(tape: Tape, row: list[Element], in_a_row: bool) -> Element:
    """Return the sum of floats in NumPy's order: from the left, but eight sums side by side along
    the inner axis.
    """
    if not in_a_row or len(row) < 8:
        return _line(tape, [0.0, *row])
    if len(row) > 128:
        raise Untraceable(f"it adds up {len(row)} numbers")
    end = len(row) - len(row) % 8
    sums = [_line(tape, row[k:end:8]) for k in range(8)]
    while len(sums) > 1:
        sums = [_line(tape, sums[k : k + 2]) for k in range(0, len(sums), 2)]
    return _line(tape, [0.0, _line(tape, [*sums, *row[end:]])])


def _line(tape: Tape, row: list[Element]) -> Element:
    """Return the sum of floats from the left."""
    while len(row) > 1 and not isinstance(row[0], Symbol) and not isinstance(row[1], Symbol):
        row = [row[0] + row[1], *row[2:]]
    if repr(row[0]) == "0.0":  # then no sum is -0.0, and a further 0 changes nothing
        row = row[:1] + [one for one in row[1:] if isinstance(one, Symbol) or one != 0]
    return row[0] if len(row) == 1 else tape.write(f"({' + '.join(['{}'] * len(row))})", row, "f")
