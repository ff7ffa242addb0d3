"""The order of a recorded graph: which operations share a loop, and which results go to memory.

Each operation is evaluated in a loop over its entries. Operations of the same shape share a loop,
a `Kernel`, where none reads what another has not computed yet. A result that only one operation
reads is computed there. A result that another kernel reads is stored.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from roletrust_env.compiled.record import Recorded, Shape

Positions: TypeAlias = npt.NDArray[np.int32]
"""Flat positions in an array, in the shape of the loops around."""


class Put(NamedTuple):
    """The computation of an array in a loop over its entries.

    Attributes:
        source: Array.
        target: Where it goes: itself, a concatenation, or the index of an output.
        positions: Flat positions in the target.
    """

    source: Recorded
    target: Recorded | int
    positions: Positions


class Kernel(NamedTuple):
    """Computations that share a loop.

    Attributes:
        shape: Lengths of the loops.
        puts: Computations, in order.
    """

    shape: Shape
    puts: list[Put]


def entries(node: Recorded) -> Positions:
    """Return the flat positions in an array, in the shape of the loops over it: a loop for each
    axis with more than one entry.
    """
    shape = [n for n in node.shape if n != 1]
    return np.arange(node.size, dtype=np.int32).reshape(shape)


def operands(node: Recorded, at: Positions) -> Iterator[tuple[Recorded, Positions]]:
    """Yield the arrays that an operation reads, and the positions in each, for its result at
    positions. The table of a gather is left out.
    """
    if node.op.startswith("reduce"):
        n = node.args[0].shape[-1]
        at = np.add.outer(at * n, np.arange(n, dtype=np.int32))
    elif node.op == "view":
        at = node.data.reshape(-1)[at]
    for arg in node.args[node.op == "gather" :]:
        yield arg, at


class Schedule:
    """The kernels of a graph.

    Attributes:
        kernels: Kernels in order.
        stored: Arrays that go to scratch memory.
        inline: Arrays that are computed where they are read.
    """

    def __init__(self, outputs: Sequence[Recorded]) -> None:
        order = _graph_order(outputs)
        self.kernels: list[Kernel] = []
        self.stored: dict[Recorded, None] = {}
        self.inline = _inlined(order, outputs)
        self._computed_in: dict[Recorded | int, int] = {}  # index of a kernel, the last one
        for node in order:
            if node.op == "concat":
                ends = np.cumsum([part.shape[node.data] for part in node.args])[:-1]
                whole = np.arange(node.size, dtype=np.int32).reshape(node.shape)
                pieces = np.split(whole, ends, node.data)
                for part, piece in zip(node.args, pieces, strict=True):
                    self._place(Put(part, node, piece.reshape(entries(part).shape)))
            elif node.args and node.op != "view" and node not in self.inline:
                self._place(Put(node, node, entries(node)))
        for k, node in enumerate(outputs):
            self._place(Put(node, k, entries(node)))

    def _place(self, put: Put) -> None:
        """Put a computation into the first kernel that can have it."""
        if not put.source.size:
            return
        at = entries(put.source)
        reads = list(self._reads(put.source, at, put.source is put.target))
        chosen = max((self._computed_in[node] + (not same) for node, same in reads), default=0)
        while chosen < len(self.kernels) and self.kernels[chosen].shape != at.shape:
            chosen += 1
        if chosen == len(self.kernels):
            self.kernels.append(Kernel(at.shape, []))
        self.kernels[chosen].puts.append(put)
        self._computed_in[put.target] = max(chosen, self._computed_in.get(put.target, 0))
        for node, _ in reads:
            if node.op == "concat" or self._computed_in[node] != chosen:
                self.stored[node] = None

    def _reads(
        self, node: Recorded, at: Positions, opened: bool
    ) -> Iterator[tuple[Recorded, bool]]:
        """Yield the computed arrays that an entry of another needs, and whether the same turn of
        the loops computes what is needed.
        """
        if opened or node.op == "view" or node in self.inline:
            if node.op == "gather" and node.args[0].op == "concat":
                yield node.args[0], False
            for arg, places in operands(node, at):
                yield from self._reads(arg, places, False)
        elif node.args:
            yield node, node.op != "concat" and np.array_equal(at, entries(node))


def _graph_order(ends: Sequence[Recorded]) -> list[Recorded]:
    """Return the arrays of a graph, each after its arguments."""
    done: dict[Recorded, None] = {}
    stack = list(reversed(ends))
    while stack:
        waiting = [arg for arg in stack[-1].args if arg not in done]
        if waiting:
            stack.extend(reversed(waiting))
        else:
            done[stack.pop()] = None
    return list(done)


_DEEPEST = 50
"""Number of operations in a chain that are computed where they are read; the next one is not."""


def _inlined(order: Sequence[Recorded], outputs: Sequence[Recorded]) -> set[Recorded]:
    """Return the arrays that are computed where they are read: once, and entry by entry."""
    reads: dict[Recorded, list[Recorded]] = {}
    for arg in [*outputs, *(arg for node in order if node.op != "view" for arg in node.args)]:
        reads.setdefault(arg.args[0] if arg.op == "view" else arg, []).append(arg)
    inlined = {
        node
        for node, uses in reads.items()
        if node.args
        and node.op != "concat"
        and not node.op.startswith("reduce")
        and len(uses) == 1
        and uses[0].size <= node.size
    }
    depths: dict[Recorded, int] = {}
    for node in order:
        depth = max((depths.get(arg, 0) for arg in node.args), default=0)
        if node.op != "view":
            depth = depth + 1 if node in inlined else 0
        if depth > _DEEPEST:
            inlined.remove(node)
            depth = 0
        depths[node] = depth
    return inlined
