"""Ratings as edges whose sums are fused: a formula is written with arrays, and runs as one compiled loop for each sum.

What a model computes for each edge is not computed at once. It becomes an expression, and a sum over it becomes a loop
that gathers, computes and adds, with nothing written in between. So there is one formula, the model's own.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array
from roletrust_env.trust import fused_kernels as kernels
from roletrust_env.trust.edges import EdgeCells, EdgeRatings
from roletrust_env.trust.ratings import PerPair

Floats = npt.NDArray[Any]

_LONGEST = 32  # operations of an expression; a longer one is computed in parts, so that compiling stays quick

_LETTERS = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "negative": "-{}",
    "absolute": "abs({})",
    "sqrt": "math.sqrt({})",
    "exp": "math.exp({})",
    "log": "math.log({})",
    "sin": "sine({})",
    "power": "",  # has a loop of its own
    "square": "{0} * {0}",
    "maximum": "max({}, {})",
    "minimum": "min({}, {})",
    "less": "{} < {}",
    "less_equal": "{} <= {}",
    "greater": "{} > {}",
    "greater_equal": "{} >= {}",
    "equal": "{} == {}",
    "not_equal": "{} != {}",
    "bitwise_and": "{} & {}",
    "bitwise_or": "{} | {}",
    "logical_and": "{} and {}",
    "logical_or": "{} or {}",
    "invert": "not {}",
    "where": "{1} if {0} else {2}",
}
"""Operations on the values of an edge, by NumPy's name. All others are computed by NumPy at once."""


class LazyCells(np.lib.mixins.NDArrayOperatorsMixin):
    """One value for each edge, which is computed when it is needed: an array of NumPy's kind, shape (E,).

    Attributes:
        dtype: Type of the values.
        shape: Number of edges, as a tuple.
        ndim: 1.
    """

    ndim = 1
    device = "cpu"

    def __init__(self, cells: "FusedCells", operation: str, parts: tuple[Any, ...], dtype: Any) -> None:
        self._cells, self._operation, self._parts, self.dtype = cells, operation, parts, np.dtype(dtype)
        self.shape = (len(cells.raters),)
        as_it_is = operation == "take" and isinstance(parts[1], str) and parts[1] == "edge"
        self._known: Floats | None = parts[0] if as_it_is else None
        self._length: int = 1 + sum(part._length for part in parts if isinstance(part, LazyCells))

    def __len__(self) -> int:
        """Return the number of edges."""
        return self.shape[0]

    def __array_namespace__(self, api_version: str | None = None) -> Any:
        """Return NumPy, whose functions are made into expressions."""
        return np

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Floats:
        """Return the values, computed once."""
        if self._known is None:
            values = np.empty(self.shape, self.dtype)
            kernels.evaluate(self.program(), self._cells.as_they_came, values)
            self._known, self._parts = values, ()  # its parts are no longer needed
        return self._known.astype(dtype or self.dtype, copy=bool(copy))

    def compute(self) -> Floats:
        """Return the values as a plain array."""
        return np.asarray(self)

    def __getitem__(self, key: Any) -> Any:
        """Return some of the values."""
        return np.asarray(self)[key]

    def __getattr__(self, name: str) -> Any:
        """Return a method or an attribute of the values."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(np.asarray(self), name)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Return the expression of an operation on each value; all others are computed at once."""
        if method == "__call__" and not options and ufunc.__name__ in _LETTERS and self._fits(inputs):
            return self._expression(ufunc.__name__, inputs, ufunc)
        return getattr(ufunc, method)(*map(_computed, inputs), **options)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        """Return the expression of a function of each value; all others are computed at once."""
        name = function.__name__
        if name == "where" and len(args) == 3 and not options and self._fits(args):
            return self._expression(name, args, function)
        if name in ("zeros_like", "ones_like") and len(args) == 1 and not options:
            return LazyCells(self._cells, "number", (float(name == "ones_like"),), self.dtype)
        if name == "astype" and len(args) == 2 and not options and np.dtype(args[1]).kind == "f":
            return LazyCells(self._cells, "multiply", (1.0, self), args[1])
        if name == "clip" and len(args) == 3 and not options and self._fits(args):
            values, low, high = args
            values = values if low is None else np.maximum(values, low)
            return values if high is None else np.minimum(values, high)
        return function(*map(_computed, args), **{name: _computed(value) for name, value in options.items()})

    def program(self) -> kernels.Program:
        """Return the expression as loops."""
        return _Writer().program(self)

    def _fits(self, parts: Any) -> bool:
        """Return whether all parts are values of these edges, or numbers."""
        return all(
            part._cells.raters is self._cells.raters
            if isinstance(part, LazyCells)
            else getattr(part, "shape", ()) in ((), self.shape)
            for part in parts
        )

    def _expression(self, name: str, parts: Any, function: Callable[..., Any]) -> "LazyCells":
        some = (np.ones(0, part.dtype) if getattr(part, "shape", ()) else part for part in parts)
        dtype = function(*some).dtype
        made = LazyCells(self._cells, name, tuple(parts), dtype)
        if made._length > _LONGEST:
            made = LazyCells(self._cells, name, tuple(map(_computed, parts)), dtype)
        return made

    @property
    def number(self) -> float | None:
        """The value of all edges, if it is one number."""
        return self._parts[0] if self._operation == "number" and self._parts else None

    @property
    def gathered(self) -> tuple[Floats, Any] | None:
        """An array and the places of the values in it, if no operation is needed."""
        if self._known is not None:
            return self._known, "edge"
        return self._parts if self._operation == "take" else None

    @property
    def operation(self) -> tuple[str, tuple[Any, ...]]:
        """The name of an operation and its parts."""
        if self._operation == "power" and isinstance(self._parts[1], int) and self._parts[1] == 2:
            return "square", self._parts[:1]
        return self._operation, self._parts


class _Writer:
    """Writes an expression as loops."""

    def __init__(self) -> None:
        self._arrays: dict[int, tuple[str, Any]] = {}
        self._rows: dict[Any, str] = {}
        self._gathers: list[str] = []
        self._stages: list[tuple[str, ...]] = []
        self._lines: list[str] = []
        self._names: dict[int, str] = {}

    def program(self, cells: LazyCells) -> kernels.Program:
        for power in self._powers(cells, set()):
            base, exponent = power.operation[1]
            row, other = self._row(id(power)), self._row((id(power), "exponent"))
            self._stage([f"{row}[n] = {self._value(base)}", f"{other}[n] = {self._value(exponent)}"])
            self._stage([f"{row}[n] = power({row}[n], {other}[n])"])
        result = self._row("result")
        self._stage([f"{result}[n] = {self._value(cells)}"])
        arrays = tuple(values for _, values in self._arrays.values())
        return kernels.Program(tuple(self._gathers), tuple(self._stages), f"{result}[n]", len(self._rows), arrays)

    def _powers(self, cells: LazyCells, seen: set[int]) -> Iterator[LazyCells]:
        """Yield the powers in an expression, which have a loop of their own; those in others first."""
        if id(cells) in seen or cells.gathered is not None:
            return
        seen.add(id(cells))
        name, parts = cells.operation
        for part in parts:
            if isinstance(part, LazyCells):
                yield from self._powers(part, seen)
        if name == "power":
            yield cells

    def _stage(self, last: list[str]) -> None:
        self._stages.append((*self._lines, *last))
        self._lines, self._names = [], {}

    def _row(self, key: Any) -> str:
        return self._rows.setdefault(key, f"g{len(self._rows)}")

    def _array(self, values: Any) -> str:
        return self._arrays.setdefault(id(values), (f"a{len(self._arrays)}", values))[0]

    def _gathered(self, values: Any, place: Any) -> str:
        """Return the value of an array at a place for each edge, from a row of them."""
        key = id(values), place if isinstance(place, str) else id(place)
        if key not in self._rows:
            at = f"{{{place}}}" if isinstance(place, str) else f"{self._array(place)}[{{edge}}]"
            self._gathers.append(f"{self._row(key)}[n] = {self._array(values)}[{at}]")
        return f"({self._row(key)}[n] != 0.0)" if values.dtype.kind == "b" else f"{self._row(key)}[n]"

    def _value(self, part: Any) -> str:
        """Return the name of a value, whose lines are written before."""
        if not isinstance(part, LazyCells):
            if isinstance(part, np.ndarray) and part.ndim:
                return self._gathered(part, "edge")
            return self._array(part) if isinstance(part, np.generic | np.ndarray) else repr(part)
        if part.gathered is not None:
            return self._gathered(*part.gathered)
        if id(part) in self._rows:
            return f"{self._row(id(part))}[n]"
        if id(part) not in self._names:
            name, parts = part.operation
            text = repr(parts[0]) if name == "number" else _LETTERS[name].format(*map(self._value, parts))
            self._names[id(part)] = f"v{len(self._names)}"
            self._lines.append(f"{self._names[id(part)]} = {text}")
        return self._names[id(part)]


def _computed(part: Any) -> Any:
    """Return an argument of a function of NumPy with its values computed."""
    if isinstance(part, tuple | list):
        return type(part)(map(_computed, part))
    return np.asarray(part) if isinstance(part, LazyCells) else part


class FusedCells(EdgeCells):
    """Pairs of raters and providers as `EdgeCells`, whose sums are compiled loops; for NumPy arrays alone."""

    def __init__(self, raters: Array, providers: Array, shape: tuple[int, int], *, twins: Array | None = None) -> None:
        """Keep the pairs; their two orders are found when they are first needed.

        Raises:
            ValueError: Numba is not installed.
        """
        kernels.numba()
        super().__init__(raters, providers, shape, twins=twins)
        self._sides: dict[bool, kernels.Side] = {}

    @property
    def as_they_came(self) -> kernels.Side:
        """The pairs in their own order."""
        nothing = np.zeros(0, np.uint32)
        return kernels.Side(nothing, self.raters, self.providers, np.arange(len(self.raters) + 1), True)

    def of_raters(self, values: Array) -> Array:
        """Return the rater's value for each edge. See `Cells.of_raters`."""
        return LazyCells(self, "take", (np.asarray(values), "rater"), values.dtype)

    def of_providers(self, values: Array) -> Array:
        """Return the provider's value for each edge. See `Cells.of_providers`."""
        return LazyCells(self, "take", (np.asarray(values), "provider"), values.dtype)

    def sum_over_raters(self, cells: Array) -> Array:
        """Return the sum by provider. See `Cells.sum_over_raters`."""
        return self._joined(cells, by_rater=False)

    def sum_over_providers(self, cells: Array) -> Array:
        """Return the sum by rater. See `Cells.sum_over_providers`."""
        return self._joined(cells, by_rater=True)

    def largest_over_raters(self, cells: Array) -> Array:
        """Return the maximum by provider, at least 0. See `Cells.largest_over_raters`."""
        return self._joined(cells, by_rater=False, largest=True)

    def _joined(self, cells: Array, *, by_rater: bool, largest: bool = False) -> Array:
        edges, dtype = self._side(by_rater), cells.dtype if cells.dtype.kind == "f" else np.dtype(np.float64)
        if isinstance(cells, LazyCells) and cells.number is not None and not largest:
            return (cells.number * np.diff(edges.first)).astype(dtype)
        if not isinstance(cells, LazyCells):
            cells = self.values_of(cells)
        out = np.zeros(len(edges.first) - 1, dtype)
        kernels.add_up(cells.program(), edges, out, by_rater=by_rater, largest=largest)
        return out

    def values_of(self, cells: Array, places: Array | None = None) -> LazyCells:
        """Return an array of values, of the edges or at a place for each of them, as an expression."""
        return LazyCells(self, "take", (np.asarray(cells), "edge" if places is None else places), cells.dtype)

    def _side(self, by_rater: bool) -> kernels.Side:
        if by_rater not in self._sides:
            size = self.shape[0 if by_rater else 1]
            self._sides[by_rater] = kernels.side(self.raters, self.providers, size, by_rater=by_rater)
        return self._sides[by_rater]


class FusedRatings(EdgeRatings, FusedCells):
    """The ratings of one round as `EdgeRatings`, whose sums are compiled loops."""

    def __init__(self, cells: FusedCells, values: Array, pairs: EdgeCells, slots: Array | None) -> None:
        FusedCells.__init__(self, cells.raters, cells.providers, cells.shape, twins=cells.twins)
        self._sides = cells._sides  # the orders, which may be known
        self.values, self.slots, self._pairs = self.values_of(values), slots, pairs
        one = np.ones_like(self.values)
        self.received, self.given = self.sum_over_raters(one), self.sum_over_providers(one)

    def recall(self, memory: PerPair) -> Array:
        """Return the memory of the pair of each edge. See `Ratings.recall`."""
        return self.values_of(memory, self.slots)

    def remember(self, memory: PerPair, cells: Array | float) -> PerPair:
        """Return a memory with the new values of the pairs of this round. See `Ratings.remember`."""
        if self.slots is None and isinstance(cells, LazyCells):
            return np.array(cells, memory.dtype)  # all pairs have new values
        return super().remember(memory, cells)
