"""The code of a scheduled graph, in the language of LLVM: loops over agents, and over games.

A batch is played with vectors of `width` games, whose entries are next to each other in memory, a
single game with numbers. Scratch memory holds one vector of games; the lock of Python keeps threads
from using it at the same time.
"""

import math
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from roletrust_env.compiled.record import INSTRUCTIONS, Recorded, UnrecordableError
from roletrust_env.compiled.schedule import Kernel, Positions, Schedule, entries, operands

ALIGNMENT = 64
"""Number of bytes of a line of the cache, at which arrays begin."""

_TYPES = {"f8": "double", "f4": "float", "i8": "i64", "i4": "i32", "i1": "i8", "b1": "i1"}


def emit(inputs: Sequence[Recorded], outputs: Sequence[Recorded], width: int) -> str:
    """Return the code that computes outputs from inputs.

    The function `run` gets the address of its arguments: the number of games, and the addresses of
    each input and of each output.

    Args:
        inputs: Inputs, in order.
        outputs: Results, in order.
        width: Number of games in a vector; 1 is for a single game.
    """
    return _Emitter(inputs, outputs, width).code()


class _Emitter:
    def __init__(self, inputs: Sequence[Recorded], outputs: Sequence[Recorded], width: int) -> None:
        self._width, self._schedule = width, Schedule(outputs)
        memory = [*inputs, *range(len(outputs))]
        self._outside: dict[Any, str] = {array: f"%a{k}" for k, array in enumerate(memory)}
        self._lines: list[str] = []
        self._allocas: list[str] = []
        self._globals: dict[str, str] = {}
        self._scratch: dict[Any, str] = {}
        for k, node in enumerate(self._schedule.stored):
            kind = f"[{node.size} x {self._vector(_stored(node.dtype))}]"
            text = f"internal global {kind} zeroinitializer, align {ALIGNMENT} ; {k}"
            self._scratch[node] = self._globals[text] = f"@s{k}"
        self._declared: set[str] = set()
        self._block, self._count = "entry", 0
        self._known: list[dict[str, str]] = [{}]  # name of each result, by loop
        self._here: dict[Recorded, str] = {}  # entries that this turn of the kernel has computed
        self._first, self._game = "0", "0"  # indices of the games of the vector
        self._variables: list[str] = []  # of the loops around

    # --- text

    def _emit(self, text: str) -> str:
        """Emit an instruction unless its result is known, and return the name of the result."""
        for known in self._known:
            if text in known:
                return known[text]
        self._count += 1
        name = self._known[-1][text] = f"%v{self._count}"
        self._lines.append(f"  {name} = {text}")
        return name

    def _vector(self, element: str) -> str:
        return element if self._width == 1 else f"<{self._width} x {element}>"

    def _type(self, dtype: Any) -> str:
        return self._vector(_element(dtype))

    def _number(self, value: Any, dtype: Any) -> str:
        """Return a number in the language of LLVM, for all games."""
        number = _literal(value, dtype)
        return number if self._width == 1 else f"splat ({_element(dtype)} {number})"

    def _splat(self, scalar: str, element: str) -> str:
        if self._width == 1:
            return scalar
        vector = self._vector(element)
        first = self._emit(f"insertelement {vector} poison, {element} {scalar}, i64 0")
        zeros = f"{self._vector('i32')} zeroinitializer"
        return self._emit(f"shufflevector {vector} {first}, {vector} poison, {zeros}")

    def _call(self, kind: str, name: str, suffix: str, arguments: Sequence[str]) -> str:
        """Emit a call of an intrinsic function whose arguments and result have one type."""
        types = ", ".join([kind] * len(arguments))
        self._declared.add(f"declare {kind} @{name}.{suffix}({types})")
        given = ", ".join(f"{kind} {argument}" for argument in arguments)
        return self._emit(f"call {kind} @{name}.{suffix}({given})")

    @contextmanager
    def _loop(self, count: int | str) -> Iterator[str]:
        """Emit a loop around what is emitted meanwhile, and give the name of its variable."""
        self._count += 1
        k, before = self._count, self._block
        self._lines += [f"  br label %l{k}", f"l{k}:", ""]
        place, self._block = len(self._lines) - 1, f"l{k}"
        self._known.append({})
        yield f"%i{k}"
        self._known.pop()
        self._lines[place] = f"  %i{k} = phi i64 [ 0, %{before} ], [ %n{k}, %{self._block} ]"
        self._lines += [
            f"  %n{k} = add nuw nsw i64 %i{k}, 1",
            f"  %c{k} = icmp eq i64 %n{k}, {count}",
            f"  br i1 %c{k}, label %e{k}, label %l{k}",
            f"e{k}:",
        ]
        self._block = f"e{k}"

    # --- memory

    def _table(self, values: Any) -> str:
        """Return the name of a constant table of numbers."""
        numbers = values.astype(np.int8) if values.dtype.kind == "b" else values
        element = _stored(values.dtype)
        listed = ", ".join(
            f"{element} {_literal(x, numbers.dtype)}" for x in numbers.reshape(-1).tolist()
        )
        text = f"private unnamed_addr constant [{values.size} x {element}] [{listed}]"
        return self._globals.setdefault(text, f"@t{len(self._globals)}")

    def _position(self, at: Positions) -> str:
        """Return the position in this turn of the loops: a sum over their variables, or listed."""
        strides = _strides(at)
        if strides is None:
            place = self._position(np.arange(at.size, dtype=np.int32).reshape(at.shape))
            small = self._emit(f"load i32, ptr {self._entry(self._table(at), 'i32', place)}")
            return self._emit(f"zext i32 {small} to i64")
        total = str(at.flat[0])
        for variable, stride in zip(self._variables, strides, strict=True):
            if stride:
                term = self._emit(f"mul nsw i64 {variable}, {stride}")
                total = self._emit(f"add nsw i64 {total}, {term}")
        return total

    def _entry(self, pointer: str, element: str, position: str) -> str:
        return self._emit(f"getelementptr inbounds {element}, ptr {pointer}, i64 {position}")

    def _address(self, memory: Any, position: str, dtype: Any) -> str:
        """Return the address of the entry of all games at a position."""
        if memory in self._scratch:
            return self._entry(self._scratch[memory], self._vector(_stored(dtype)), position)
        if self._width == 1:
            return self._entry(self._outside[memory], _stored(dtype), position)
        row = self._emit(f"mul nsw i64 {position}, %games")
        place = self._emit(f"add nsw i64 {row}, {self._first}")
        address = self._entry(self._outside[memory], _stored(dtype), place)
        following = f"getelementptr inbounds {self._vector(_stored(dtype))}, ptr {address}, i64 1"
        if following not in self._known[-1]:
            # The rows are too many for the processor to fetch the next vector by itself.
            self._declared.add("declare void @llvm.prefetch.p0(ptr, i32, i32, i32)")
            fetched = f"ptr {self._emit(following)}, i32 0, i32 3, i32 1"
            self._lines.append(f"  call void @llvm.prefetch.p0({fetched})")
        return address

    def _load(self, node: Recorded, at: Positions) -> str:
        position, element = self._position(at), _stored(node.dtype)
        kind = self._vector(element)
        if node.op in ("constant", "key"):  # the same for all games
            table = self._table(node.data) if node.op == "constant" else self._outside[node]
            one = self._emit(f"load {element}, ptr {self._entry(table, element, position)}")
            value = self._splat(one, element)
        else:
            address = self._address(node, position, node.dtype)
            value = self._emit(f"load {kind}, ptr {address}, align {node.dtype.itemsize}")
        return self._from_memory(value, node.dtype)

    def _from_memory(self, value: str, dtype: Any) -> str:
        if dtype.kind != "b":
            return value
        return self._emit(f"icmp ne {self._vector('i8')} {value}, {self._number(0, np.int8)}")

    def _store(self, value: str, dtype: Any, memory: Any, at: Positions) -> None:
        address, kind = self._address(memory, self._position(at), dtype), self._type(dtype)
        if dtype.kind == "b":
            value = self._emit(f"zext {kind} {value} to {self._vector('i8')}")
            kind = self._vector("i8")
        self._lines.append(f"  store {kind} {value}, ptr {address}, align {dtype.itemsize}")

    # --- values

    def _value(self, node: Recorded, at: Positions) -> str:
        """Return the name of the entry of an array at a position."""
        if node in self._here and np.array_equal(at, entries(node)):
            return self._here[node]
        if node.op == "view":
            ((base, places),) = operands(node, at)
            return self._value(base, places)
        if node in self._schedule.inline:
            return self._computed(node, at)
        if node.op == "game":
            return self._game
        if node.op == "constant":
            values = node.data.reshape(-1)[at]
            first = values.flat[0]
            if np.array_equal(values, np.full_like(values, first), equal_nan=first != first):
                return self._number(first, node.dtype)
        return self._load(node, at)

    def _computed(self, node: Recorded, at: Positions) -> str:
        """Emit an operation, and return the name of its result."""
        if node.op.startswith("reduce_"):
            return self._reduced(node, at)
        args = [self._value(arg, places) for arg, places in operands(node, at)]
        if node.op == "gather":
            return self._gathered(node, args[0])
        source, kind = node.args[0].dtype, self._type(node.dtype)
        before = self._type(source)
        if node.op == "where":
            return self._emit(f"select {before} {args[0]}, {kind} {args[1]}, {kind} {args[2]}")
        if node.op == "bitcast":
            return self._emit(f"bitcast {before} {args[0]} to {kind}")
        if node.op == "cast":
            made = self._emit(f"{_conversion(source, node.dtype)} {before} {args[0]} to {kind}")
            return self._emit(f"freeze {kind} {made}")  # NaN is no whole number
        return self._operation(node.op, source, args)

    def _operation(self, name: str, dtype: Any, args: Sequence[str]) -> str:
        instruction, kind = INSTRUCTIONS[dtype.kind][name], self._type(dtype)
        if instruction.startswith("llvm."):
            lanes = "" if self._width == 1 else f"v{self._width}"
            suffix = f"{lanes}{dtype.kind}{8 * dtype.itemsize}"
            return self._call(kind, instruction, suffix, args)
        return self._emit(f"{instruction} {kind} {', '.join(args)}")

    def _reduced(self, node: Recorded, at: Positions) -> str:
        name, kind = node.op.removeprefix("reduce_"), self._type(node.dtype)
        self._count += 1
        total = f"%total{self._count}"
        self._allocas.append(f"  {total} = alloca {kind}")
        first = self._number(_neutral(name, node.dtype), node.dtype)
        self._lines.append(f"  store {kind} {first}, ptr {total}")
        with self._loop(node.args[0].shape[-1]) as variable:
            self._variables.append(variable)
            ((rows, places),) = operands(node, at)
            value = self._value(rows, places)
            so_far = self._emit(f"load {kind}, ptr {total}")
            after = self._operation(name, node.dtype, [value, so_far])
            self._lines.append(f"  store {kind} {after}, ptr {total}")
            self._variables.pop()
        return self._emit(f"load {kind}, ptr {total}")

    def _gathered(self, node: Recorded, at: str) -> str:
        """Emit the look-up of an entry of its own for each game."""
        table, element = node.args[0], _stored(node.dtype)
        found, kind = "poison", self._vector(element)
        for game in range(self._width):
            place = at
            if self._width > 1:
                place = self._emit(f"extractelement {self._vector('i64')} {at}, i64 {game}")
            if table.op == "constant":
                address = self._entry(self._table(table.data), element, place)
            else:
                address = self._entry(self._address(table, place, node.dtype), element, str(game))
            one = self._emit(f"load {element}, ptr {address}")
            if self._width == 1:
                found = one
            else:
                found = self._emit(f"insertelement {kind} {found}, {element} {one}, i64 {game}")
        return self._from_memory(found, node.dtype)

    # --- the function

    def code(self) -> str:
        """Return the code of all kernels, for all games."""
        if self._width == 1:
            self._kernels()
        else:
            self._batch()
        pointers = [f"ptr {name}" for name in self._outside.values()]
        words = []
        for k, argument in enumerate(["i64 %games", *pointers]):
            kind, name = argument.split()
            words += [
                f"  %w{k} = getelementptr i64, ptr %words, i64 {k}",
                f"  {name} = load {kind}, ptr %w{k}",
            ]
        given = ", ".join(["i64 %games", *pointers])
        return "\n".join(
            [
                *(f"{name} = {text}" for text, name in self._globals.items()),
                *sorted(self._declared),
                f"define internal void @play({given.replace('ptr', 'ptr noalias')}) {{",
                "entry:",
                *self._allocas,
                *self._lines,
                "  ret void",
                "}",
                "define void @run(ptr %words) {",
                *words,
                f"  call void @play({given})",
                "  ret void",
                "}",
                "",
            ]
        )

    def _batch(self) -> None:
        """Emit a loop over vectors of games. The last one overlaps the one before."""
        width = self._width
        more = self._emit(f"add nsw i64 %games, {width - 1}")
        last = self._emit(f"sub nsw i64 %games, {width}")
        with self._loop(self._emit(f"udiv i64 {more}, {width}")) as vector:
            start = self._emit(f"mul nuw nsw i64 {vector}, {width}")
            self._first = self._call("i64", "llvm.smin", "i64", [start, last])
            first = self._splat(self._emit(f"trunc i64 {self._first} to i32"), "i32")
            steps = ", ".join(f"i32 {k}" for k in range(width))
            self._game = self._emit(f"add {self._vector('i32')} {first}, <{steps}>")
            self._kernels()

    def _kernels(self) -> None:
        for kernel in self._schedule.kernels:
            self._kernel(kernel, kernel.shape)

    def _kernel(self, kernel: Kernel, shape: Sequence[int]) -> None:
        """Emit the loops of a kernel over the rest of its shape."""
        if shape:
            with self._loop(shape[0]) as variable:
                self._variables.append(variable)
                self._kernel(kernel, shape[1:])
                self._variables.pop()
            return
        self._here = {}
        self._known.append({})
        for source, target, positions in kernel.puts:
            at = entries(source)
            if source is target:
                value = self._here[source] = self._computed(source, at)
            else:
                value = self._value(source, at)
            if source is not target or source in self._scratch:
                self._store(value, source.dtype, target, positions)
        self._known.pop()


def _strides(at: Positions) -> list[int] | None:
    """Return the steps of positions along each axis; None if they are not constant."""
    strides = []
    for axis in range(at.ndim):
        steps = np.diff(at, axis=axis)
        if (steps != steps.flat[0]).any():
            return None
        strides.append(int(steps.flat[0]))
    return strides


def _element(dtype: Any) -> str:
    kind = np.dtype(dtype).str[1:]
    if kind not in _TYPES:
        raise UnrecordableError(f"there are no compiled numbers of dtype {dtype}")
    return _TYPES[kind]


def _stored(dtype: Any) -> str:
    """Return the type of a number in memory."""
    return "i8" if dtype.kind == "b" else _element(dtype)


def _conversion(source: Any, target: Any) -> str:
    wider = source.itemsize < target.itemsize
    return {
        "ff": "fpext" if wider else "fptrunc",
        "fi": "fptosi",
        "if": "sitofp",
        "ii": "sext" if wider else "trunc",
        "bi": "zext",
        "bf": "uitofp",
    }[source.kind + target.kind]


def _literal(value: Any, dtype: Any) -> str:
    if np.dtype(dtype).kind == "b":
        return "true" if value else "false"
    if np.dtype(dtype).kind != "f":
        return str(int(value))
    return f"0x{struct.unpack('<Q', struct.pack('<d', float(value)))[0]:016X}"


def _neutral(name: str, dtype: Any) -> float:
    """Return the number that a reduction begins with."""
    known = {"multiply": 1, "logical_and": 1, "maximum": -math.inf, "minimum": math.inf}
    if dtype.kind == "i":
        known |= {"maximum": np.iinfo(dtype).min, "minimum": np.iinfo(dtype).max}
    return known.get(name, 0)
