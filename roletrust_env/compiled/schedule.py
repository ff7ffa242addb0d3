"""The order of a recorded graph: which operations share a loop, and which results go to memory.

Each operation is evaluated in a loop over its entries. Operations of the same shape share a loop,
a `Kernel`, where none reads what another has not computed yet. A result that only one operation
reads is computed there. A result that another kernel reads is stored.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from roletrust_env.compiled.record import Recorded

Positions: TypeAlias = npt.NDArray[Any]

ALIGNMENT = 64
"""Number of bytes of a line of the cache, at which arrays in memory begin."""


class Affine(NamedTuple):
    """Positions that are a sum over the axes: `offset + sum of index x stride`."""

    offset: int
    strides: tuple[int, ...]

    @classmethod
    def of(cls, positions: Positions) -> "Affine | None":
        """Return the strides of positions; None if they are no such sum."""
        if not positions.size:
            return cls(0, (0,) * positions.ndim)
        offset, strides, expected = int(positions.flat[0]), [], np.asarray(positions.flat[0])
        for axis, n in enumerate(positions.shape):
            second = tuple(int(k == axis) for k in range(positions.ndim))
            stride = int(positions[second]) - offset if n > 1 else 0
            expected = expected[..., None] + np.arange(n) * stride
            strides.append(stride)
        return cls(offset, tuple(strides)) if np.array_equal(expected, positions) else None


def by_axis(shown: Recorded) -> list[Affine] | None:
    """Return where along each axis of its argument a view reads; None if that is no sum."""
    base = shown.args[0]
    places = np.unravel_index(shown.data, base.shape) if base.shape else ()
    axes = [Affine.of(axis) for axis in places]
    return None if None in axes else [axis for axis in axes if axis is not None]


class Put(NamedTuple):
    """A copy of an array to memory: to an output, or to a concatenation.

    Attributes:
        source: Array.
        target: Place of the output, or concatenation.
        positions: Flat positions in the target, in the shape of the source.
    """

    source: Recorded
    target: Any
    positions: Positions


Item: TypeAlias = Recorded | Put


@dataclass
class Kernel:
    """Operations that share a loop.

    Attributes:
        shape: Lengths of the loops.
        items: Operations, in order.
    """

    shape: tuple[int, ...]
    items: list[Item] = field(default_factory=list)


def loops(shape: Sequence[int]) -> tuple[int, ...]:
    """Return the lengths of the loops over a shape: those of axes with more than one entry."""
    return tuple(n for n in shape if n != 1)


def graph_order(ends: Sequence[Recorded]) -> list[Recorded]:
    """Return the arrays of a graph, each after its arguments."""
    done: dict[int, Recorded] = {}
    stack = list(reversed(ends))
    while stack:
        node = stack[-1]
        waiting = [arg for arg in node.args if id(arg) not in done]
        if id(node) in done or not waiting:
            done.setdefault(id(node), stack.pop())
        else:
            stack.extend(reversed(waiting))
    return list(done.values())


class Schedule:
    """The kernels of a graph.

    Args:
        outputs: Copies of results to their places.

    Attributes:
        kernels: Kernels in order.
        spans: First and last kernel that need the memory of each stored array.
        inline: Arrays that are computed where they are read.
    """

    def __init__(self, outputs: Sequence[Put]) -> None:
        outputs = [part for put in outputs for part in _parts(put) if part.source.size]
        order = graph_order([put.source for put in outputs])
        self.kernels: list[Kernel] = []
        self.spans: dict[Recorded, tuple[int, int]] = {}
        self.inline = _inlined(order, outputs)
        self._at: dict[Recorded, int] = {}
        for node in order:
            if node.op == "concat":
                for part, positions in zip(node.args, node.data, strict=True):
                    at = self._place(Put(part, node, positions), part.shape)
                    first, last = self.spans.get(node, (at, at))
                    self.spans[node] = min(first, at), max(last, at)
                self._at[node] = self.spans[node][1] + 1
            elif node.op not in ("constant", "input", "view") and node not in self.inline:
                self._at[node] = self._place(node, node.shape)
        for put in outputs:
            self._place(put, put.source.shape)

    def _place(self, item: Item, shape: tuple[int, ...]) -> int:
        """Put an operation into the first kernel that can have it; return its index."""
        needed, earliest = loops(shape), 0
        size = math.prod(shape)
        reads = list(self._reads(item, size))
        for node, same in reads:
            if node in self._at:
                late = not same or loops(node.shape) != needed or node.op == "concat"
                earliest = max(earliest, self._at[node] + (late and node.op != "concat"))
        at = next(
            (k for k in range(earliest, len(self.kernels)) if self.kernels[k].shape == needed),
            len(self.kernels),
        )
        if at == len(self.kernels):
            self.kernels.append(Kernel(needed))
        self.kernels[at].items.append(item)
        for node, _ in reads:
            if node.op == "concat" or self._at.get(node, at) != at:
                first, last = self.spans.get(node, (self._at[node], at))
                self.spans[node] = first, max(last, at)
        return at

    def _reads(self, item: Item, size: int) -> Iterator[tuple[Recorded, bool]]:
        """Yield the arrays that an operation reads, and whether it reads only its own entry."""
        if isinstance(item, Put):
            yield from self._leaves(item.source, np.arange(size), size)
        else:
            yield from self._tables(item)
            for arg in item.args[item.op == "gather" :]:
                yield from self._leaves(arg, np.arange(arg.size), size)

    def _tables(self, node: Recorded) -> Iterator[tuple[Recorded, bool]]:
        if node.op == "gather" and node.args[0].op != "constant":
            yield node.args[0], False

    def _leaves(self, node: Recorded, at: Positions, size: int) -> Iterator[tuple[Recorded, bool]]:
        if node.op == "constant":
            return
        if node.op == "view":
            yield from self._leaves(node.args[0], node.data.reshape(-1)[at], size)
        elif node not in self.inline:
            yield node, len(at) == size == node.size and bool((at == np.arange(size)).all())
        else:
            yield from self._tables(node)
            for arg in node.args[node.op == "gather" :]:
                yield from self._leaves(arg, at, size)


def _parts(put: Put) -> Iterator[Put]:
    """Yield the copies of the parts of a concatenation, which needs no memory of its own then."""
    if put.source.op != "concat":
        yield put
        return
    for part, places in zip(put.source.args, put.source.data, strict=True):
        yield from _parts(Put(part, put.target, put.positions.reshape(-1)[places]))


def _base(node: Recorded) -> Recorded:
    return node.args[0] if node.op == "view" else node


def _inlined(order: Sequence[Recorded], outputs: Sequence[Put]) -> set[Recorded]:
    """Return the arrays that are computed where they are read: once, and entry by entry."""
    uses: dict[Recorded, set[Recorded]] = {}
    readers: dict[Recorded, set[int]] = {}
    tables: set[Recorded] = set()
    ends = [(k, (put.source,)) for k, put in enumerate(outputs)]
    for reader, args in [*((id(n), n.args) for n in order if n.op != "view"), *ends]:
        for arg in args:
            uses.setdefault(_base(arg), set()).add(arg)
            readers.setdefault(_base(arg), set()).add(reader)
    for node in order:
        if node.op == "gather":
            tables.add(node.args[0])
    inline = set()
    for node in order:
        if node.op in ("constant", "input", "view", "concat") or node.op.startswith("reduce"):
            continue
        if node in tables or len(uses[node]) > 1 or len(readers[node]) > 1:
            continue
        (read,) = uses[node]
        if read is node or (read.size <= node.size and by_axis(read) is not None):
            inline.add(node)
    return inline


def allocated(schedule: Schedule, width: int) -> tuple[int, dict[Recorded, int]]:
    """Return the size of the scratch memory, and the place of each stored array in it.

    Arrays that are not needed at the same time share memory.
    """
    offsets: dict[Recorded, int] = {}
    top = 0
    for node, (first, last) in sorted(schedule.spans.items(), key=lambda span: span[1]):
        size = _size(node, width)
        taken = sorted(
            (at, at + _size(other, width))
            for other, at in offsets.items()
            if schedule.spans[other][0] <= last and first <= schedule.spans[other][1]
        )
        at = 0
        for start, end in taken:
            if at + size <= start:
                break
            at = max(at, end)
        offsets[node] = at
        top = max(top, at + size)
    return top, offsets


def _size(node: Recorded, width: int) -> int:
    """Return the number of bytes of an array in scratch memory."""
    used = node.size * int(node.dtype.itemsize) * width
    return -(-used // ALIGNMENT) * ALIGNMENT
