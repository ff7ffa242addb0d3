"""The code of a scheduled graph, in the language of LLVM: loops over agents, and over games.

One game is played with numbers, a batch with vectors of `width` games. Otherwise the code is the
same. An array in memory has the games last. Scratch memory holds `width` games.
"""

import math
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.compiled.record import Recorded, UnrecordableError
from roletrust_env.compiled.schedule import (
    ALIGNMENT,
    Affine,
    Item,
    Put,
    Schedule,
    allocated,
    by_axis,
)

BLOCKS = ("before", "after", "inputs", "outputs", "shared", "scratch")
"""Blocks of memory that the function gets, in order after the number of games."""

_TYPES = {"f8": "double", "f4": "float", "i8": "i64", "i4": "i32", "b1": "i1"}
_BINARY = {
    "add": ("fadd contract", "add"),
    "subtract": ("fsub contract", "sub"),
    "multiply": ("fmul contract", "mul"),
    "divide": ("fdiv contract", ""),
    "bitwise_and": ("", "and"),
    "bitwise_or": ("", "or"),
    "bitwise_xor": ("", "xor"),
    "left_shift": ("", "shl"),
    "right_shift": ("", "ashr"),
    "less": ("fcmp olt", "icmp slt"),
    "less_equal": ("fcmp ole", "icmp sle"),
    "greater": ("fcmp ogt", "icmp sgt"),
    "greater_equal": ("fcmp oge", "icmp sge"),
    "equal": ("fcmp oeq", "icmp eq"),
    "not_equal": ("fcmp une", "icmp ne"),
}
_UNARY = {"absolute": "fabs", "sqrt": "sqrt", "floor": "floor", "rint": "rint"}
_CHUNK = 1_000_000
"""Number of bytes of games that are copied at once: about a cache of the second level."""

_MOST_VECTORS = 8


class Place(NamedTuple):
    """Place of an array outside of the graph.

    Attributes:
        block: Name of a block of memory.
        offset: Number of bytes before the array, for each game; in `"shared"` for all games.
        dtype: Dtype in memory.
    """

    block: str
    offset: int
    dtype: Any


class Index(NamedTuple):
    """A position: a constant, plus variables of loops times factors."""

    constant: int
    terms: tuple[tuple[str, int], ...] = ()

    @classmethod
    def sum(cls, affine: Affine, indices: "Sequence[Index]") -> "Index":
        """Return the position that strides give for the positions along each axis."""
        constant, terms = affine.offset, dict[str, int]()
        for stride, index in zip(affine.strides, indices, strict=True):
            constant += stride * index.constant
            for name, factor in index.terms:
                terms[name] = terms.get(name, 0) + stride * factor
        return cls(constant, tuple(sorted((name, f) for name, f in terms.items() if f)))


class Code(NamedTuple):
    """Source of the function `run`, and the number of bytes of scratch memory that it needs."""

    source: str
    scratch: int


def emit(inputs: dict[Recorded, Place], outputs: Sequence[Put], width: int) -> Code:
    """Return the code that computes outputs from inputs.

    Args:
        inputs: Place of each input.
        outputs: Copies of results to their places.
        width: Number of games in a vector; 1 is for a single game.
    """
    return _Emitter(inputs, Schedule(outputs), width).code()


def _contiguous(shape: tuple[int, ...]) -> Affine:
    strides = [math.prod(shape[k + 1 :]) for k in range(len(shape))]
    return Affine(0, tuple(strides))


class _Emitter:
    def __init__(self, inputs: dict[Recorded, Place], schedule: Schedule, width: int) -> None:
        self._inputs, self._schedule, self._width = inputs, schedule, width
        self._lines: list[str] = []
        self._globals: dict[str, str] = {}
        self._declared: set[str] = set()
        self._allocas: list[str] = []
        self._block, self._count = "entry", 0
        self._memo: list[dict[Any, str]] = [{}]
        self._scratch, self._offsets = allocated(schedule, width)
        self._staged: dict[str, int] = {}  # where the games of a chunk are in scratch memory
        self._vectors: dict[str, tuple[tuple[str, int], ...]] = {}

    # --- text

    def _new(self) -> str:
        self._count += 1
        return f"%v{self._count}"

    def _emit(self, text: str) -> str:
        """Emit an instruction, and return the name of its result."""
        name = self._new()
        self._lines.append(f"  {name} = {text}")
        return name

    def _type(self, dtype: Any) -> str:
        kind = np.dtype(dtype).str[1:]
        if kind not in _TYPES:
            raise UnrecordableError(f"there are no compiled numbers of dtype {dtype}")
        return self._vector(_TYPES[kind])

    def _vector(self, element: str) -> str:
        return element if self._width == 1 else f"<{self._width} x {element}>"

    def _number(self, value: Any, dtype: Any) -> str:
        """Return a number in the language of LLVM."""
        text = _literal(value, dtype)
        if self._width == 1:
            return text
        return f"splat ({_TYPES[np.dtype(dtype).str[1:]]} {text})"

    def _splat(self, scalar: str, element: str) -> str:
        if self._width == 1:
            return scalar
        vector = self._vector(element)
        first = self._emit(f"insertelement {vector} poison, {element} {scalar}, i64 0")
        zeros = f"<{self._width} x i32> zeroinitializer"
        return self._emit(f"shufflevector {vector} {first}, {vector} poison, {zeros}")

    def _call(self, function: str, dtype: Any, *args: str) -> str:
        kind = self._type(dtype)
        suffix = np.dtype(dtype).str[1] + str(8 * np.dtype(dtype).itemsize)
        name = f"@llvm.{function}.{'' if self._width == 1 else f'v{self._width}'}{suffix}"
        flag = ", i1 false" if function == "abs" else ""
        self._declared.add(
            f"declare {kind} {name}({', '.join([kind] * len(args))}{', i1' if flag else ''})"
        )
        given = ", ".join(f"{kind} {arg}" for arg in args)
        return self._emit(f"call {kind} {name}({given}{flag})")

    @contextmanager
    def _loop(self, count: int | str) -> Iterator[str]:
        """Emit a loop around what is emitted meanwhile, and give the name of its variable."""
        self._count += 1
        k, before = self._count, self._block
        self._lines += [f"  br label %l{k}", f"l{k}:", ""]
        place, self._block = len(self._lines) - 1, f"l{k}"
        self._memo.append({})
        yield f"%i{k}"
        self._memo.pop()
        self._lines[place] = f"  %i{k} = phi i64 [ 0, %{before} ], [ %n{k}, %{self._block} ]"
        self._lines += [
            f"  %n{k} = add nuw nsw i64 %i{k}, 1",
            f"  %c{k} = icmp eq i64 %n{k}, {count}",
            f"  br i1 %c{k}, label %e{k}, label %l{k}",
            f"e{k}:",
        ]
        self._block = f"e{k}"

    # --- memory

    def _known(self, key: Any) -> str | None:
        return next((memo[key] for memo in reversed(self._memo) if key in memo), None)

    def _position(self, index: Index) -> str:
        """Return a position as a number of 64 bits."""
        if not index.terms:
            return str(index.constant)
        if (known := self._known(index)) is not None:
            return known
        total = ""
        for name, factor in index.terms:
            term = name if factor == 1 else self._emit(f"mul nsw i64 {name}, {factor}")
            total = term if not total else self._emit(f"add nsw i64 {total}, {term}")
        if index.constant:
            total = self._emit(f"add nsw i64 {total}, {index.constant}")
        self._memo[-1][index] = total
        return total

    def _bytes(self, index: Index, size: int, offset: int) -> Index:
        return Index.sum(Affine(offset, (size,)), [index])

    def _pointer(self, block: str, position: str) -> str:
        return self._emit(f"getelementptr inbounds i8, ptr %{block}, i64 {position}")

    def _address(self, memory: Any, index: Index) -> tuple[str, Any]:
        """Return the address of an entry, and the dtype in memory."""
        if isinstance(memory, Place):
            size, block = np.dtype(memory.dtype).itemsize, memory.block
            if self._width == 1 or block == "shared":
                position = self._position(self._bytes(index, size, memory.offset))
                return self._pointer(block, position), memory.dtype
            at = self._bytes(index, size * self._width, memory.offset * self._width)
            terms = tuple(sorted((*at.terms, *self._vectors[block])))
            position = self._position(Index(at.constant + self._staged[block], terms))
            return self._pointer("scratch", position), memory.dtype
        size = memory.dtype.itemsize * self._width
        position = self._position(self._bytes(index, size, self._offsets[memory]))
        return self._pointer("scratch", position), memory.dtype

    def _load(self, address: str, dtype: Any, scalar: bool = False) -> str:
        """Return the numbers at an address; one number for all games if `scalar`."""
        element = _TYPES[np.dtype(dtype).str[1:]]
        stored = "i8" if np.dtype(dtype).kind == "b" else element
        align = np.dtype(dtype).itemsize
        kind = stored if scalar else self._vector(stored)
        value = self._emit(f"load {kind}, ptr {address}, align {align}")
        if np.dtype(dtype).kind == "b":
            zero = "0" if scalar or self._width == 1 else "zeroinitializer"
            value = self._emit(f"icmp ne {kind} {value}, {zero}")
        return self._splat(value, element) if scalar else value

    def _store(self, value: str, source: Any, memory: Any, index: Index) -> None:
        address, dtype = self._address(memory, index)
        kind = self._type(dtype)
        value = self._cast(value, source, np.dtype(dtype))
        if np.dtype(dtype).kind == "b":
            stored = self._vector("i8")
            value, kind = self._emit(f"zext {kind} {value} to {stored}"), stored
        self._lines.append(
            f"  store {kind} {value}, ptr {address}, align {np.dtype(dtype).itemsize}"
        )

    def _table(self, values: Any) -> str:
        """Return the name of a constant table of numbers."""
        element = "i8" if values.dtype.kind == "b" else _TYPES[values.dtype.str[1:]]
        kind = np.dtype(np.int8) if values.dtype.kind == "b" else values.dtype
        entries = ", ".join(f"{element} {_literal(x, kind)}" for x in values.reshape(-1).tolist())
        text = f"private unnamed_addr constant [{values.size} x {element}] [{entries}]"
        return self._globals.setdefault(text, f"@t{len(self._globals)}")

    def _entry(self, table: str, element: str, position: str) -> str:
        return self._emit(f"getelementptr inbounds {element}, ptr {table}, i64 {position}")

    # --- values

    def value(self, node: Recorded, indices: Sequence[Index]) -> str:
        """Return the name of an entry of an array, at a position along each axis."""
        if node.op == "constant":
            return self._constant(node, indices)
        if node.op == "view" and node.args[0] in self._schedule.inline:
            axes = by_axis(node)
            assert axes is not None  # or it is not inlined
            return self.value(node.args[0], [Index.sum(axis, indices) for axis in axes])
        base, flat = self._flat(node, indices)
        key = base, flat
        if (known := self._known(key)) is not None:
            return known
        if base.op == "input" or base in self._offsets:
            value = self._read(base, flat)
        else:
            value = self._computed(base, indices)
        self._memo[-1][key] = value
        return value

    def _flat(self, node: Recorded, indices: Sequence[Index]) -> tuple[Recorded, Index]:
        """Return the array in memory behind an array, and the flat position in it."""
        if node.op != "view":
            return node, Index.sum(_contiguous(node.shape), indices)
        return node.args[0], self._listed(node.data, indices)

    def _listed(self, positions: Any, indices: Sequence[Index]) -> Index:
        """Return the entry of an array of positions."""
        affine = Affine.of(positions)
        if affine is not None:
            return Index.sum(affine, indices)
        at = self._position(Index.sum(_contiguous(positions.shape), indices))
        key = positions.tobytes(), at
        known = self._known(key)
        if known is None:
            address = self._entry(self._table(positions.astype(np.int32)), "i32", at)
            small = self._emit(f"load i32, ptr {address}, align 4")
            known = self._memo[-1][key] = self._emit(f"zext i32 {small} to i64")
        return Index(0, ((known, 1),))

    def _read(self, node: Recorded, flat: Index) -> str:
        memory: Any = self._inputs.get(node, node)
        if isinstance(memory, Place) and memory.block == "games":
            return "%game" if self._width > 1 else "0"
        address, dtype = self._address(memory, flat)
        shared = isinstance(memory, Place) and memory.block == "shared"
        return self._load(address, dtype, scalar=shared)

    def _constant(self, node: Recorded, indices: Sequence[Index]) -> str:
        values = node.data
        if not values.size or (values == values.flat[0]).all():
            return self._number(values.flat[0], node.dtype)
        if (values != values).all():
            return self._number(math.nan, node.dtype)
        index = Index.sum(_contiguous(values.shape), indices)
        if not index.terms:
            return self._number(values.flat[index.constant], node.dtype)
        key = node, index
        if (known := self._known(key)) is None:
            element = "i8" if node.dtype.kind == "b" else _TYPES[node.dtype.str[1:]]
            address = self._entry(self._table(values), element, self._position(index))
            known = self._memo[-1][key] = self._load(address, node.dtype, scalar=True)
        return known

    def _computed(self, node: Recorded, indices: Sequence[Index]) -> str:
        if node.op.startswith("reduce_"):
            return self._reduced(node, indices)
        if node.op == "gather":
            return self._gathered(node, indices)
        args = [self.value(arg, indices) for arg in node.args]
        if node.op == "where":
            condition, kind = self._type(bool), self._type(node.dtype)
            return self._emit(f"select {condition} {args[0]}, {kind} {args[1]}, {kind} {args[2]}")
        source = node.args[0].dtype
        if node.op == "cast":
            return self._cast(args[0], source, node.dtype)
        if node.op == "bitcast":
            return self._emit(f"bitcast {self._type(source)} {args[0]} to {self._type(node.dtype)}")
        return self._operation(node.op, source, args)

    def _operation(self, name: str, dtype: Any, args: Sequence[str]) -> str:
        kind, is_float = self._type(dtype), dtype.kind == "f"
        if name in _BINARY:
            return self._emit(f"{_BINARY[name][not is_float]} {kind} {args[0]}, {args[1]}")
        if name == "invert":
            return self._emit(f"xor {kind} {args[0]}, {self._number(-1, dtype)}")
        if name == "negative":
            zero = f"sub {kind} {self._number(0, dtype)}, "
            return self._emit(f"{f'fneg {kind} ' if is_float else zero}{args[0]}")
        if name in ("minimum", "maximum"):
            if not is_float:
                return self._call("smin" if name == "minimum" else "smax", dtype, *args)
            return self._extreme("ult" if name == "minimum" else "ugt", kind, *args)
        function = _UNARY[name]
        return self._call("abs" if not is_float else function, dtype, args[0])

    def _extreme(self, test: str, kind: str, one: str, other: str) -> str:
        """Return the lesser or greater of two numbers; NaN if either is."""
        flags = self._vector("i1")
        first = self._emit(f"fcmp {test} {kind} {one}, {other}")
        chosen = self._emit(f"select {flags} {first}, {kind} {one}, {kind} {other}")
        if not other.startswith("%"):
            return chosen
        unordered = self._emit(f"fcmp uno {kind} {other}, {other}")
        return self._emit(f"select {flags} {unordered}, {kind} {other}, {kind} {chosen}")

    def _cast(self, value: str, source: Any, target: Any) -> str:
        source, target = np.dtype(source), np.dtype(target)
        if source == target:
            return value
        before, after = self._type(source), self._type(target)
        if source.kind == "b" and target.kind == "f":
            one, zero = self._number(1, target), self._number(0, target)
            return self._emit(f"select {before} {value}, {after} {one}, {after} {zero}")
        if target.kind == "b":
            test = "fcmp une" if source.kind == "f" else "icmp ne"
            return self._emit(f"{test} {before} {value}, {self._number(0, source)}")
        wider = source.itemsize < target.itemsize
        name = {
            "ff": "fpext" if wider else "fptrunc",
            "fi": "fptosi",
            "if": "sitofp",
            "ii": "sext" if wider else "trunc",
            "bi": "zext",
        }[source.kind + target.kind]
        made = self._emit(f"{name} {before} {value} to {after}")
        return self._emit(f"freeze {after} {made}") if name == "fptosi" else made

    def _reduced(self, node: Recorded, indices: Sequence[Index]) -> str:
        (rows,) = node.args
        name, kind = node.op.removeprefix("reduce_"), self._type(node.dtype)
        total = self._new()
        self._allocas.append(f"  {total} = alloca {kind}, align {ALIGNMENT}")
        first = self._number(_identity(name, node.dtype), node.dtype)
        self._lines.append(f"  store {kind} {first}, ptr {total}")
        with self._loop(rows.shape[-1]) as variable:
            value = self.value(rows, [*indices, Index(0, ((variable, 1),))])
            so_far = self._emit(f"load {kind}, ptr {total}")
            after = self._operation(name, node.dtype, [value, so_far])
            self._lines.append(f"  store {kind} {after}, ptr {total}")
        return self._emit(f"load {kind}, ptr {total}")

    def _gathered(self, node: Recorded, indices: Sequence[Index]) -> str:
        table, at = node.args[0], self.value(node.args[1], indices)
        element, kind = _TYPES[node.dtype.str[1:]], self._type(node.dtype)
        stored, found = "i8" if node.dtype.kind == "b" else element, "poison"
        for game in range(self._width):
            place = at
            if self._width > 1:
                place = self._emit(f"extractelement <{self._width} x i64> {at}, i64 {game}")
            if table.op == "constant":
                address = self._entry(self._table(table.data), stored, place)
            else:
                address, _ = self._address(self._inputs.get(table, table), Index(0, ((place, 1),)))
                lane = game * node.dtype.itemsize
                address = self._emit(f"getelementptr inbounds i8, ptr {address}, i64 {lane}")
            value = self._emit(f"load {stored}, ptr {address}")
            if node.dtype.kind == "b":
                value = self._emit(f"icmp ne i8 {value}, 0")
            if self._width == 1:
                return value
            found = self._emit(f"insertelement {kind} {found}, {element} {value}, i64 {game}")
        return found

    # --- the function

    def code(self) -> Code:
        """Return the code of all kernels, for all games."""
        if self._width == 1:
            self._kernels()
        else:
            self._chunks()
        types = ", ".join(
            f"ptr noalias {'readonly ' * (name in ('before', 'inputs', 'shared'))}%{name}"
            for name in BLOCKS
        )
        return Code(
            "\n".join(
                [
                    *(f"{name} = {text}" for text, name in self._globals.items()),
                    *sorted(self._declared),
                    f"define internal void @play(i64 %games, {types}) {{",
                    "entry:",
                    *self._allocas,
                    *self._lines,
                    "  ret void",
                    "}",
                    _run(),
                ]
            ),
            self._scratch,
        )

    def _chunks(self) -> None:
        """Emit a loop over chunks of vectors of games, which are copied to scratch memory and back.

        In a batch the numbers of one game lie far apart. The last vector overlaps the one before.
        """
        width, groups = self._width, self._groups()
        sizes = {block: width * sum(size * n for size, _, n in groups[block]) for block in groups}
        vectors = max(2, min(_MOST_VECTORS, _CHUNK // sum(sizes.values())))
        for block in groups:
            self._staged[block] = self._scratch
            self._scratch += vectors * sizes[block] + ALIGNMENT
        more = self._emit(f"add nsw i64 %games, {width - 1}")
        in_all = self._emit(f"udiv i64 {more}, {width}")
        more = self._emit(f"add nsw i64 {in_all}, {vectors - 1}")
        chunks = self._emit(f"udiv i64 {more}, {vectors}")
        last = self._emit(f"sub nsw i64 %games, {width}")

        def first_game(first: str, vector: str) -> str:
            start = self._emit(f"add nuw nsw i64 {first}, {vector}")
            start = self._emit(f"mul nuw nsw i64 {start}, {width}")
            return self._call_scalar("smin", start, last)

        def copy(first: str, many: str, blocks: Sequence[str], inwards: bool) -> None:
            for block in blocks:
                for size, offset, count in groups[block]:
                    with self._loop(count) as row, self._loop(many) as vector:
                        there = self._position(Index(offset, ((row, size),)))
                        there = self._emit(f"mul nsw i64 {there}, %games")
                        games = self._emit(f"mul nsw i64 {first_game(first, vector)}, {size}")
                        there = self._emit(f"add nsw i64 {there}, {games}")
                        here = Index(
                            self._staged[block] + offset * width,
                            ((row, size * width), (vector, sizes[block])),
                        )
                        ends = [
                            self._pointer(block, there),
                            self._pointer("scratch", self._position(here)),
                        ]
                        source, target = ends if inwards else ends[::-1]
                        kind = f"<{width} x i{8 * size}>"
                        value = self._emit(f"load {kind}, ptr {source}, align {size}")
                        self._lines.append(f"  store {kind} {value}, ptr {target}, align {size}")

        with self._loop(chunks) as chunk:
            first = self._emit(f"mul nuw nsw i64 {chunk}, {vectors}")
            rest = self._emit(f"sub nuw nsw i64 {in_all}, {first}")
            many = self._call_scalar("smin", rest, str(vectors))
            copy(first, many, ("before", "inputs"), inwards=True)
            with self._loop(many) as vector:
                self._vectors = {block: ((vector, sizes[block]),) for block in groups}
                game = self._emit(f"trunc i64 {first_game(first, vector)} to i32")
                steps = ", ".join(f"i32 {k}" for k in range(width))
                all_first = self._splat(game, "i32")
                self._lines.append(f"  %game = add <{width} x i32> {all_first}, <{steps}>")
                self._kernels()
            copy(first, many, ("after", "outputs"), inwards=False)

    def _groups(self) -> dict[str, list[tuple[int, int, int]]]:
        """Return, for each block, the numbers of each size: their size, offset and count."""
        puts = (item for kernel in self._schedule.kernels for item in kernel.items)
        arrays = [(place, node.size) for node, place in self._inputs.items()] + [
            (put.target, put.source.size)
            for put in puts
            if isinstance(put, Put) and isinstance(put.target, Place)
        ]
        groups: dict[str, list[tuple[int, int, int]]] = {}
        for block in ("before", "inputs", "after", "outputs"):
            own = [(place, n) for place, n in arrays if place.block == block]
            groups[block] = []
            for size in sorted({np.dtype(place.dtype).itemsize for place, _ in own}):
                same = [(p.offset, n) for p, n in own if np.dtype(p.dtype).itemsize == size]
                groups[block].append((size, min(same)[0], sum(n for _, n in same)))
        return groups

    def _call_scalar(self, function: str, one: str, other: str) -> str:
        self._declared.add(f"declare i64 @llvm.{function}.i64(i64, i64)")
        return self._emit(f"call i64 @llvm.{function}.i64(i64 {one}, i64 {other})")

    def _kernels(self) -> None:
        for kernel in self._schedule.kernels:
            self._memo.append({})
            self._nest(kernel.shape, kernel.items, ())
            self._memo.pop()

    def _nest(
        self, shape: tuple[int, ...], items: Sequence[Item], variables: tuple[Index, ...]
    ) -> None:
        if shape:
            with self._loop(shape[0]) as variable:
                self._nest(shape[1:], items, (*variables, Index(0, ((variable, 1),))))
            return
        for item in items:
            source = item.source if isinstance(item, Put) else item
            rest = iter(variables)
            indices = [Index(0) if n == 1 else next(rest) for n in source.shape]
            if isinstance(item, Put):
                value = self.value(source, indices)
                self._store(value, source.dtype, item.target, self._listed(item.positions, indices))
                continue
            value = self._computed(source, indices)
            self._memo[-1][source, Index.sum(_contiguous(source.shape), indices)] = value
            if source in self._offsets:
                self._store(
                    value, source.dtype, source, Index.sum(_contiguous(source.shape), indices)
                )


def _run() -> str:
    """Return the source of the function `run` of seven words, which are the arguments of `play`."""
    lines = ["define void @run(ptr %words) {"]
    for k, name in enumerate(("games", *BLOCKS)):
        kind = "ptr" if k else "i64"
        lines += [
            f"  %at{k} = getelementptr i64, ptr %words, i64 {k}",
            f"  %{name} = load {kind}, ptr %at{k}",
        ]
    given = ", ".join(["i64 %games", *(f"ptr %{name}" for name in BLOCKS)])
    return "\n".join([*lines, f"  call void @play({given})", "  ret void", "}", ""])


def _literal(value: Any, dtype: Any) -> str:
    if np.dtype(dtype).kind == "b":
        return "true" if value else "false"
    if np.dtype(dtype).kind != "f":
        return str(int(value))
    return f"0x{struct.unpack('<Q', struct.pack('<d', float(value)))[0]:016X}"


def _identity(name: str, dtype: Any) -> float:
    """Return the number that a reduction begins with."""
    if name in ("maximum", "minimum") and dtype.kind == "f":
        return -math.inf if name == "maximum" else math.inf
    if name in ("maximum", "minimum"):
        return int(np.iinfo(dtype).min) if name == "maximum" else int(np.iinfo(dtype).max)
    return 1 if name in ("multiply", "bitwise_and") else 0
