"""A written round in C, which plays on the numbers of one game where they lie in memory."""

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate, chain, pairwise
from typing import Any

import numpy as np

from roletrust_env.arrays import Array
from roletrust_env.game.traced.c_code import TYPES, c_body, prelude
from roletrust_env.game.traced.compiler import SharedObject, compiler
from roletrust_env.game.traced.tape import Element, Operation, Symbol, Tape, Untraceable

_running: list[SharedObject] = []
"""What the compiler makes in the background: at most one at a time, as other work on the machine is
to go on."""


class Memory:
    """The numbers of one game, one after the other, as floats in double precision.

    Args:
        shapes: Shapes of the actions, of each field of the noise and of each result.
        n_noise: Number of fields of the noise.
        size: Number of the numbers of a state, or more.
        n_called: Number of the numbers that called functions take and return, or more.

    Attributes:
        pointers: Addresses of the first number, and of the first in `called`.
        actions: Actions of a round.
        noise: Fields of the noise that are there.
        results: What a round returns; None as the round has it.
        state: Numbers of the state, which a round replaces.
        called: Numbers that called functions take and return.
        calls: Functions that a round calls, part by part, with their arguments and results, by the
            round.
    """

    def __init__(
        self, shapes: Sequence[tuple[int, ...] | None], n_noise: int, size: int, n_called: int
    ) -> None:
        ends = [0, *accumulate(0 if shape is None else math.prod(shape) for shape in shapes)]
        whole, self.called = np.zeros(ends[-1] + size), np.zeros(n_called)
        parts: list[Any] = [
            None if shape is None else whole[a:b].reshape(shape)
            for shape, (a, b) in zip(shapes, pairwise(ends), strict=True)
        ]
        self.pointers = ctypes.c_void_p(whole.ctypes.data), ctypes.c_void_p(self.called.ctypes.data)
        self.actions, self.noise, self.results = (
            parts[0],
            parts[1 : 1 + n_noise],
            parts[1 + n_noise :],
        )
        self.state = whole[ends[-1] :]
        self.calls: dict[
            CompiledRound, list[list[tuple[Callable[..., Array], list[Array], Array]]]
        ] = {}


class CompiledRound:
    """A round in C. It plays in a `Memory`.

    Functions of NumPy that C does not have are called between parts in C. Each part begins with the
    inputs and with what was called before, so it computes some numbers again, and needs no further
    place in memory.

    Args:
        tape: Operations of the round.
        inputs: Symbols of the state, of the actions and of each field of the noise.
        outputs: Elements of the next state, and of each result.

    Attributes:
        ready: Whether it can play.
        size: Number of the numbers of a state, before the round or after it.
        n_called: Number of the numbers that called functions take and return.
    """

    def __init__(
        self,
        tape: Tape,
        inputs: Sequence[Sequence[Symbol]],
        outputs: Sequence[Sequence[Element] | None],
    ) -> None:
        self.ready = False
        self.size, self.n_called = max(len(inputs[0]), len(outputs[0] or ())), 0
        self._round: Any = tape, inputs, [one or () for one in outputs]
        self._source = ""
        self._object: SharedObject | None = None
        self._left = 2  # tries: a process that is forked meanwhile does not see how the first ends
        self._calls: list[list[tuple[Callable[..., Array], list[slice], slice]]] = []
        self._parts: list[Callable[[ctypes.c_void_p, ctypes.c_void_p], None]] = []

    def build(self, wait: bool) -> bool:
        """Start the compiler, or look what it made, and return whether there is nothing more to do.

        Args:
            wait: Whether to wait until it is done.
        """
        if self._object is None:
            if not wait and any(not one.ready for one in _running):
                return False
            try:
                self._source = self._source or self._written(*self._round)
                self._object = SharedObject(self._source)
            except (Untraceable, OSError):  # such as a full disk
                return True
            self._round = None
            _running[:] = [*(one for one in _running if not one.ready), self._object]
        if not wait and not self._object.ready:
            return False
        library, self._object = self._object.load(), None
        if library is not None:
            # A function keeps the lock of Python: to give it away takes longer than a round.
            prototype = ctypes.PYFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
            self._parts = [prototype((f"play_{k}", library)) for k in range(1 + len(self._calls))]
            self.ready = True
        self._left -= 1
        return self.ready or not self._left

    def _written(
        self, tape: Tape, inputs: Sequence[Sequence[Symbol]], outputs: Sequence[Sequence[Element]]
    ) -> str:
        """Return the source.

        Raises:
            Untraceable: C cannot express an operation, or the machine has no compiler.
        """
        if compiler() is None:
            raise Untraceable("the machine has no C compiler")
        if tape.names["sin"] is not math.sin:
            raise Untraceable("NumPy's sine is not that of C")
        (state, *given), (after, *results) = inputs, outputs
        taken, returned = list(chain(*given)), list(chain(*results))
        first = len(taken) + len(returned)
        places = {symbol: f"x[{k}]" for k, symbol in enumerate(taken)}
        places |= {symbol: f"x[{first + k}]" for k, symbol in enumerate(state)}
        parts = []
        for stage in _stages(tape, [*returned, *after]):
            targets, calls = [], []
            for one in stage:
                assert one.call is not None
                function, lengths = one.call
                ends = [*accumulate([*lengths, len(one.results)], initial=self.n_called)]
                targets += [
                    (f"y[{self.n_called + k}]", element) for k, element in enumerate(one.arguments)
                ]
                calls.append(
                    (function, [slice(*pair) for pair in pairwise(ends[:-1])], slice(*ends[-2:]))
                )
                self.n_called = ends[-1]
            parts.append(_part(tape, places, targets))
            self._calls.append(calls)
            for one, (*_, found) in zip(stage, calls, strict=True):
                places |= {symbol: f"y[{found.start + k}]" for k, symbol in enumerate(one.results)}
        parts.append(
            _part(
                tape,
                places,
                [(f"x[{k}]", one) for k, one in enumerate([*returned, *after], len(taken))],
            )
        )
        tables = dict.fromkeys(table for _, tables in parts for table in tables)
        functions = [
            f"void play_{k}(double *x, double *y) {{\n{lines}\n}}"
            for k, (lines, _) in enumerate(parts)
        ]
        return "\n".join([prelude("double"), *tables, *functions])

    def play(self, memory: Memory) -> None:
        """Play the round."""
        at, called = memory.pointers
        calls = memory.calls.get(self)
        if calls is None:
            numbers = memory.called
            calls = memory.calls[self] = [
                [
                    (function, [numbers[cut] for cut in given], numbers[found])
                    for function, given, found in stage
                ]
                for stage in self._calls
            ]
        for part, stage in zip(self._parts, calls, strict=False):
            part(at, called)
            for function, given, found in stage:
                found[:] = function(*given)
        self._parts[-1](at, called)


def _stages(tape: Tape, outputs: Sequence[Element]) -> list[list[Operation]]:
    """Return the calls of a round: first those of inputs alone, then those of what these return,
    and so on.
    """
    stages: list[list[Operation]] = []
    stage_of: dict[Symbol, int] = {}
    for one in tape.needed(element for element in outputs if isinstance(element, Symbol)):
        stage = max((stage_of.get(symbol, 0) for symbol in one.symbols()), default=0)
        if one.call:
            stages += [[]] * (stage == len(stages))
            stages[stage] = [*stages[stage], one]
            stage += 1
        stage_of |= dict.fromkeys(one.results, stage)
    return stages


def _part(
    tape: Tape, places: Mapping[Symbol, str], targets: Sequence[tuple[str, Element]]
) -> tuple[str, list[str]]:
    """Return the statements that set the targets, and the tables that they use."""
    # All is read before anything is written: the next state lies where this one was.
    names = {symbol: f"in{k}" for k, symbol in enumerate(places)}
    reads = [
        f"const {TYPES[symbol.kind]} {names[symbol]} = {place};" for symbol, place in places.items()
    ]
    lines, tables = c_body(tape, names, targets, "double")
    return "\n".join([*reads, *lines]), tables
