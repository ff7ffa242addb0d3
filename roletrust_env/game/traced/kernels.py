"""Kernels: rounds of many games at once, in C that is written from the rules of one game."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from ctypes import c_int64, c_void_p
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.arrays import Array
from roletrust_env.game.traced.c_code import TYPES, c_body, prelude
from roletrust_env.game.traced.compiler import SharedObject, compiler
from roletrust_env.game.traced.rounds import (
    MOST_FORMS,
    Layout,
    Leaf,
    elements_of,
    map_named,
    on_numpy,
)
from roletrust_env.game.traced.tape import Element, Symbol, Tape, Untraceable
from roletrust_env.parameters import whole_number
from roletrust_env.trees import leaves, map_leaves

MOST_OPERATIONS = 10_000
"""Number of operations in a round above which the compiler would take minutes; at 6,000 it takes
one."""

_FLAGS = (
    *(
        "-O2",
        "-march=native",
        "-ffp-contract=off",
        "-fno-math-errno",
        "-fno-trapping-math",
        "-fopenmp-simd",
    ),
    "-D__FAST_MATH__",  # glibc's header then offers vectors of sines, logarithms and the like
    *(
        "-fno-builtin-cos",
        "-fno-builtin-cosf",
    ),  # gcc would join a cosine to a sine in a way that is no vector
)

_STRIP = 128
"""Number of games whose numbers fit into the cache."""

_SLICE = 1024
"""Least number of games for which a thread is worth its while."""

Place = tuple[int, int]


class Kernel:
    """A function of one game that plays a batch of games in C, in the precision of the state.

    The function is traced as in `Rounds`, for each layout of flags and constants, and the C
    compiler of the machine compiles it. Sums and functions such as the logarithm may differ from
    NumPy's in the last digits. The numbers of a game do not depend on the size of the batch and on
    the threads.

    Args:
        step: Pure function of a state and of further inputs, which returns the next state and what
            else is wanted. All are trees of arrays whose last axis is that of the games; words,
            uint32, are keys of all games.
        threads: Number of threads that play a large batch.

    Raises:
        ValueError: The number of threads is not at least 1, or there is no C compiler.

    Example:
        >>> from roletrust_env import Actions, Game, make_scenario
        >>> game = Game(make_scenario("paper-3x3"), like=np.zeros((), np.float32))
        >>> def play(state, actions, key):
        ...     state, rewards = game.step(state, actions, game.noise(key, state.round.shape))
        ...     return state, rewards, game.observations(state)
        >>> kernel, random = Kernel(play, threads=2), game.random(seed=0)
        >>> state = game.start(game.draw(random, (5000,), start=True))
        >>> actions = Actions(random.uniform((3, 5000)), random.uniform((3, 3, 5000)))
        >>> state, rewards, observations = kernel(state, actions, random.round_key())
        >>> rewards.shape
        (6, 5000)
    """

    def __init__(self, step: Callable[..., tuple[Any, ...]], threads: int = 1) -> None:
        threads = whole_number("threads", threads, 1)
        if compiler() is None:
            raise ValueError(
                "a kernel needs a C compiler, and there is no cc: install gcc or clang, or set CC"
            )
        self._step, self._threads = step, threads
        self._forms: dict[Any, _Form] = {}
        self._last: _Batch | None = None

    def __reduce__(self) -> Any:
        return Kernel, (self._step, self._threads)

    def __call__(self, state: Any, *inputs: Any) -> tuple[Any, ...]:
        """Return what the function returns, for a batch of games. The arrays of a state are not to
        be written to.

        Raises:
            ValueError: The function does what cannot be written in C, or arrays are not of the same
                batch.
        """
        last = self._last  # another thread may set it
        before = last if last is not None and state is last.state else _Batch.of(state)
        games, given = (
            before.games,
            [_checked(leaf, before.games) for leaf in leaves(inputs) if on_numpy(leaf)],
        )
        key = before.layout.key, *((array.dtype, array.shape[:-1]) for array in given)
        form = self._forms.get(key)
        if form is None:
            if len(self._forms) >= MOST_FORMS:
                raise ValueError(
                    f"there is no kernel: the rounds have more than {MOST_FORMS} forms"
                )
            form = self._forms[key] = _form(self._step, before, inputs)
        made = [_addressed(np.empty((*shape, games), dtype)) for shape, dtype in form.made]
        read = [
            *(before.arrays[k][1] for k in form.read[0]),
            *(_addressed(given[k])[1] for k in form.read[1]),
        ]
        self._play(
            form,
            games,
            (c_void_p * len(read))(*read),
            (c_void_p * len(made))(*(at for _, at in made)),
        )
        known = before.arrays, made, form.constants(games)
        arrays = [known[k][place] for k, place in form.arrays]
        rest = iter(arrays)
        after, *results = map_leaves(
            lambda leaf: next(rest)[0] if leaf is _ARRAY else leaf, form.tree
        )
        self._last = _Batch(after, form.after, games, arrays)
        return after, *results

    def _play(self, form: "_Form", games: int, *places: Any) -> None:
        """Play a round of all games."""
        width = max(_SLICE, -(-games // (self._threads * _STRIP)) * _STRIP)
        slices = [
            (first, min(games, first + width), games, *places) for first in range(0, games, width)
        ]
        others = [_pool(os.getpid(), self._threads).submit(form.play, *one) for one in slices[1:]]
        form.play(*slices[0])
        for other in others:
            other.result()


class _Batch(NamedTuple):
    """A state of a batch.

    Attributes:
        state: State.
        layout: Layout of the state of one game.
        games: Number of games.
        arrays: Arrays of the state and their addresses, in order; others may follow.
    """

    state: Any
    layout: Layout
    games: int
    arrays: list[tuple[Array, int]]

    @classmethod
    def of(cls, state: Any) -> "_Batch":
        """Return a state of which nothing is known. Arrays of flags that are all equal are
        constants.
        """
        games = next((leaf.shape[-1] for leaf in leaves(state) if on_numpy(leaf) and leaf.ndim), 0)
        if games == 0:
            raise ValueError(
                "the state is of no batch: its arrays must have the games as their last axis"
            )
        arrays = [_checked(leaf, games) for leaf in leaves(state) if on_numpy(leaf)]
        return cls(state, _layout(state, constant_flags=True), games, list(map(_addressed, arrays)))


class _Form(NamedTuple):
    """A compiled function, for states of one layout.

    Attributes:
        play: Function in C of the first and the last game of a slice, the number of games, and the
            addresses of the arrays that it reads and makes.
        read: Places of the arrays that it reads, among those of the state and among those of the
            inputs.
        made: Shape in one game and dtype of each array that it makes.
        constants: Arrays that are constant and their addresses, for a number of games.
        tree: What it returns, with `_ARRAY` in place of arrays.
        arrays: Place of each of these: 0 and a place in the state, 1 and in what is made, 2 and in
            the constants.
        after: Layout of the next state.
    """

    play: Callable[..., None]
    read: list[list[int]]
    made: tuple[tuple[tuple[int, ...], Any], ...]
    constants: Callable[[int], list[tuple[Array, int]]]
    tree: Any
    arrays: list[Place]
    after: Layout


_ARRAY = object()


@cache
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Return the threads beside the one that calls; a process that is forked has its own."""
    return ThreadPoolExecutor(threads - 1)


def _checked(array: Array, games: int) -> Array:
    """Return an array in C order that is of so many games, or of keys."""
    if array.dtype != np.uint32 and array.shape[-1:] != (games,):
        raise ValueError(
            f"an array has the shape {array.shape}; its last axis must be that of the {games} games"
        )
    return np.ascontiguousarray(array)


def _addressed(array: Array) -> tuple[Array, int]:
    return array, array.__array_interface__["data"][0]


def _of_one(array: Array) -> Array:
    """Return what an array says of one game."""
    return array if array.dtype == np.uint32 else array[..., 0]


def _layout(tree: Any, constant_flags: bool) -> Layout:
    """Return the layout of a batch, in which all numbers may change, and flags where they are not
    all equal.
    """

    def leaf(name: str, part: Any) -> Any:
        if not on_numpy(part):
            return part
        one = _of_one(part)
        fixed = (
            constant_flags
            and one.dtype == bool
            and one.size > 0
            and bool((part == one.flat[0]).all())
        )
        return Leaf(name, one, tuple(one.ravel().tolist()) if fixed else (None,) * one.size)

    return Layout(map_named(leaf, tree))


def _form(step: Callable[..., Any], before: _Batch, inputs: Any) -> _Form:
    """Return the form of a function for states of a layout, with inputs as an example.

    Raises:
        ValueError: The function cannot be written in C.
    """
    tape = Tape(MOST_OPERATIONS, for_c=True)
    examples = map_leaves(
        lambda leaf: _of_one(leaf) if on_numpy(leaf) else leaf, (before.state, inputs)
    )
    layouts = before.layout, _layout(inputs, constant_flags=False)
    try:
        state, given = (
            layout.symbols(one, tape)[0] for layout, one in zip(layouts, examples, strict=True)
        )
        after, *results = step(state, *given)
        code = _Code(
            tape,
            "double" if any(array.dtype == np.float64 for array, _ in before.arrays) else "float",
        )
        read = [
            [k for k, leaf in enumerate(filter(on_numpy, leaves(tree))) if code.read(leaf)]
            for tree in (state, given)
        ]
        places = {_identity(leaf): (0, k) for k, leaf in enumerate(filter(on_numpy, leaves(state)))}
        constants: list[Any] = []
        for leaf in filter(on_numpy, leaves(after)):
            if _identity(leaf) in places:
                continue
            if any(map(_is_symbol, elements_of(leaf))):
                places[_identity(leaf)] = 1, code.make(leaf)
            else:
                places[_identity(leaf)] = 2, len(constants)
                constants.append(leaf)
        arrays = [places[_identity(leaf)] for leaf in leaves(after) if on_numpy(leaf)]
        arrays += [
            (1, code.make(leaf)) for leaf in leaves(tuple(results)) if on_numpy(leaf)
        ]  # nobody else's
        source = code.source()
    except Untraceable as error:
        raise ValueError(f"there is no kernel for these games: {error}") from None
    library = SharedObject(source, _FLAGS).load() or SharedObject(source, _FLAGS[:1]).load()
    if library is None:
        raise ValueError("there is no kernel for these games: the C compiler refuses it")
    library.play.argtypes, library.play.restype = [c_int64] * 3 + [c_void_p] * 2, None

    def full(games: int) -> list[tuple[Array, int]]:
        return [
            _addressed(np.repeat(np.asarray(leaf)[..., None], games, axis=-1)) for leaf in constants
        ]

    tree = map_leaves(lambda leaf: _ARRAY if on_numpy(leaf) else leaf, (after, *results))
    return _Form(
        library.play,
        read,
        tuple(code.made),
        cache(full),
        tree,
        arrays,
        layouts[0].following(after)[0],
    )


def _is_symbol(element: Element) -> bool:
    return isinstance(element, Symbol)


def _identity(leaf: Any) -> Any:
    """Return a hashable value that arrays of a trace share that are equal."""
    return leaf.dtype.char, leaf.shape, tuple(map(repr, elements_of(leaf)))


def _c_type(dtype: Any) -> str:
    return {"float32": "float", "float64": "double", "bool": "uint8_t"}.get(
        str(dtype), f"{dtype}_t"
    )


class _Code:
    """The source of a kernel, which copies the numbers of a strip of games to rows, plays them, and
    copies back.

    For in large batches the numbers of a game lie far apart, each on another page, and where the
    number of games is a power of 2, all in the same place of the cache.

    Attributes:
        made: Shape in one game and dtype of each array that it makes.
    """

    def __init__(self, tape: Tape, real: str) -> None:
        self.made: list[tuple[tuple[int, ...], Any]] = []
        self._tape, self._real = tape, real
        self._rows: dict[str, dict[str, int]] = {}  # of each C type the row of each element
        self._names: dict[Symbol, str] = {}
        self._n_read = 0
        self._words: list[str] = []
        self._before: list[str] = []
        self._loads: list[str] = []
        self._targets: list[tuple[str, Element]] = []
        self._after: list[str] = []

    def read(self, leaf: Any) -> bool:
        """Read the next array that is given, and return whether there is a symbol in it; else it is
        not read.
        """
        kind, symbols = (
            _c_type(leaf.dtype),
            [(k, one) for k, one in enumerate(elements_of(leaf)) if _is_symbol(one)],
        )
        for k, symbol in symbols:
            self._names[symbol] = name = f"x{len(self._names)}"
            if (
                symbol.kind == "u"
            ):  # a game has the key of the batch, but for the second of four words
                self._words.append(
                    f"const word w{len(self._words)} = ((const uint32_t *)in[{self._n_read}])[{k}];"
                )
                number = f"w{len(self._words) - 1}{' + (word)(s + i)' * (k % 4 == 1)}"
            else:
                row, _ = self._row(kind, symbol)
                number = f"{row}[i]"
                self._before.append(
                    f"memcpy({row}, ({kind} *)in[{self._n_read}] + {k} * n + s, m * "
                    f"sizeof({kind}));"
                )
            self._loads.append(f"const {TYPES[symbol.kind]} {name} = {number};")
        self._n_read += bool(symbols)
        return bool(symbols)

    def make(self, leaf: Any) -> int:
        """Make an array of the elements of a leaf, and return its place."""
        kind, array = _c_type(leaf.dtype), len(self.made)
        for k, element in enumerate(elements_of(leaf)):
            row, new = self._row(kind, element)
            self._targets += [(f"{row}[i]", element)] * new
            self._after.append(
                f"memcpy(({kind} *)out[{array}] + {k} * n + s, {row}, m * sizeof({kind}));"
            )
        self.made.append((leaf.shape, leaf.dtype))
        return array

    def source(self) -> str:
        """Return the source."""
        lines, tables = c_body(self._tape, self._names, self._targets, self._real)
        return "\n".join(
            [
                "#include <string.h>",
                prelude(self._real),
                f"extern real cos{'f' * (self._real == 'float')}(real) __attribute__((const));",
                *tables,
                *(
                    f"static _Thread_local {kind} {kind}_rows[{len(rows)}][{_STRIP}];"
                    for kind, rows in self._rows.items()
                ),
                "void play(int64_t first, int64_t last, int64_t n, void *const *in, void *const "
                "*out) {",
                *self._words,
                f"for (int64_t s = first; s < last; s += {_STRIP}) {{",
                f"const int64_t m = last - s < {_STRIP} ? last - s : {_STRIP};",
                *self._before,
                "#pragma omp simd",
                f"for (int i = 0; i < {_STRIP}; i++) {{",
                *self._loads,
                *lines,
                "}",
                *self._after,
                "}",
                "}",
            ]
        )

    def _row(self, kind: str, element: Element) -> tuple[str, bool]:
        """Return the row of an element in a strip, and whether it is new."""
        rows = self._rows.setdefault(kind, {})
        new = repr(element) not in rows
        return f"{kind}_rows[{rows.setdefault(repr(element), len(rows))}]", new
