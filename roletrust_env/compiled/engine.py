"""Compiled rounds: a round of the rules is recorded once, compiled, and played from then on."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from roletrust_env.compiled.emit import BLOCKS, Place, emit
from roletrust_env.compiled.library import Function, load
from roletrust_env.compiled.record import Recorded, UnrecordableError, constant, make_input
from roletrust_env.compiled.schedule import Put
from roletrust_env.trees import is_array, leaves, map_leaves

Memory = npt.NDArray[np.uint8]
Play = Callable[..., tuple[Any, Any]]
"""A round: a pure function of a state and of further inputs, which returns the next state and a
tree of whatever else is wanted."""


def recorded_like(dtype: Any = np.float64) -> Recorded:
    """Return the array to make a game or a task with, as its argument `like`, so that it can be
    recorded.
    """
    return constant(np.zeros((), dtype))


class Layout:
    """The places of the arrays of a tree in a block of memory. Flags of Python are false in it.

    Args:
        tree: Arrays of one game; other leaves are None or flags.

    Attributes:
        arrays: Shape in one game, dtype and number of bytes before it of each array.
        size: Number of bytes of one game.
    """

    def __init__(self, tree: Any) -> None:
        self._tree = map_leaves(lambda leaf: None if leaf is None else is_array(leaf), tree)
        arrays = [leaf if isinstance(leaf, Recorded) else np.asarray(leaf) for leaf in _arrays(tree)]
        # The longest numbers first, so that all are aligned for any number of games.
        starts, self.size = dict[int, int](), 0
        for k in sorted(range(len(arrays)), key=lambda k: -arrays[k].dtype.itemsize):
            starts[k] = self.size
            self.size += arrays[k].size * arrays[k].dtype.itemsize
        self.arrays = [(a.shape, a.dtype, starts[k]) for k, a in enumerate(arrays)]

    def tree(self, parts: Any) -> Any:
        """Return a tree of this structure with other arrays, in order."""
        rest = iter(parts)
        return map_leaves(lambda leaf: next(rest) if leaf else leaf, self._tree)

    def views(self, memory: Memory, games: tuple[int, ...] = ()) -> list[npt.NDArray[Any]]:
        """Return the arrays in a block of memory, for a batch of this shape."""
        many = math.prod(games)
        return [
            np.ndarray((*shape, *games), dtype, memory.data, start * many)
            for shape, dtype, start in self.arrays
        ]


def _arrays(tree: Any) -> list[Any]:
    return [leaf for leaf in leaves(tree) if is_array(leaf)]


class Program(NamedTuple):
    """A compiled round.

    Attributes:
        state: Layout of the state.
        inputs: Layout of the inputs of each game.
        keys: Layout of the keys, which are the same for all games.
        outputs: Layout of what a round returns.
        source: Source of the round, in the language of LLVM.
        scratch: Number of bytes of scratch memory.
        width: Number of games that are played at once.
    """

    state: Layout
    inputs: Layout
    keys: Layout
    outputs: Layout
    source: str
    scratch: int
    width: int

    @classmethod
    def of(cls, play: Play, state: Any, inputs: tuple[Any, ...], batch: bool) -> "Program":
        """Record a round.

        Args:
            play: Round of a game that was made with `recorded_like`.
            state: Example of a state of one game, on NumPy.
            inputs: Example of the inputs for one game. Words, uint32, are keys: in a batch the
                second of four words is that of the first game, and one more for each next game.
            batch: Whether the program is for batches.

        Raises:
            UnrecordableError: A rule cannot be recorded.
        """
        words = [isinstance(x, np.ndarray) and x.dtype == np.uint32 for x in inputs]
        before = Layout(state)
        given = Layout(tuple(x for x, word in zip(inputs, words, strict=True) if not word))
        keys = Layout(tuple(x for x, word in zip(inputs, words, strict=True) if word))
        places: dict[Recorded, Place] = {}

        def make(layout: Layout, block: str) -> list[Recorded]:
            made = [
                make_input(f"{block} {k}", shape, np.int32 if dtype == np.uint32 else dtype)
                for k, (shape, dtype, _) in enumerate(layout.arrays)
            ]
            for node, (_, _, start) in zip(made, layout.arrays, strict=True):
                places[node] = Place(block, start, node.dtype)
            return made

        game = make_input("game", (), np.int32)
        places[game] = Place("games", 0, np.int32)
        second = np.asarray([0, 1, 0, 0], np.int32)
        symbols = before.tree(make(before, "before"))
        of_keys = iter([key + game * second for key in make(keys, "shared")])
        of_games = given.tree(make(given, "inputs"))
        rest = iter(of_games)
        after, outputs = play(
            symbols, *(next(of_keys) if word else next(rest) for word in words)
        )
        after, outputs = map_leaves(_recorded, after), map_leaves(_recorded, outputs)
        shapes = [(leaf.shape, leaf.dtype.kind) for leaf in _arrays(after)]
        if shapes != [(shape, dtype.kind) for shape, dtype, _ in before.arrays]:
            raise UnrecordableError("a round changes the structure of the state")
        results = Layout(outputs)
        puts = [
            Put(leaf, Place(block, start, dtype), np.arange(leaf.size).reshape(leaf.shape))
            for block, layout, tree in (("after", before, after), ("outputs", results, outputs))
            for leaf, (_, dtype, start) in zip(_arrays(tree), layout.arrays, strict=True)
        ]
        width = 1
        if batch:
            double = any(dtype == np.float64 for _, dtype, _ in before.arrays)
            width = 8 if double else 16
        code = emit(places, puts, width)
        return cls(before, given, keys, results, code.source, code.scratch, width)

    def function(self) -> Function:
        """Return the compiled function."""
        return load(self.source, keep_lock=self.width == 1)


def _recorded(leaf: Any) -> Any:
    return constant(leaf) if is_array(leaf) else leaf


def _block(size: int) -> Memory:
    """Return memory that begins where a line of the cache does."""
    memory = np.empty(size + 64, np.uint8)
    start = -_address(memory) % 64
    return memory[start : start + size]


def _address(memory: Memory) -> int:
    address: int = memory.__array_interface__["data"][0]
    return address


class CompiledGame:
    """One game in progress, played by a compiled round.

    Args:
        program: Compiled round of one game.

    Example:
        >>> from roletrust_env import Game, make_scenario
        >>> from roletrust_env.game.state import Actions
        >>> def play(game):
        ...     def round(state, quality, ratings, key):
        ...         after, rewards = game.step(state, Actions(quality, ratings), game.noise(key))
        ...         return after, (rewards,)
        ...     return round
        >>> scenario = make_scenario("paper-3x3")
        >>> game, twin = Game(scenario), Game(scenario, like=recorded_like())
        >>> random = game.random(seed=0)
        >>> state = game.start(game.draw(random, start=True))
        >>> example = state.quality, state.ratings, random.round_key()
        >>> compiled = CompiledGame(Program.of(play(twin), state, example, batch=False))
        >>> compiled.begin(state)
        >>> (rewards,) = compiled.play(state.quality, state.ratings, random.round_key())
        >>> rewards.shape, int(compiled.state.round)
        ((6,), 1)
    """

    def __init__(self, program: Program) -> None:
        self.program = program
        self._states = [_block(program.state.size) for _ in range(2)]
        self._blocks = [
            _block(layout.size) for layout in (program.inputs, program.outputs, program.keys)
        ] + [_block(program.scratch)]
        inputs, outputs, keys, _ = self._blocks
        self._inputs = program.inputs.views(inputs)
        self._keys = program.keys.views(keys)
        self._outputs = program.outputs.tree(program.outputs.views(outputs))
        self._views = [program.state.views(memory) for memory in self._states]
        fixed = [_address(block) for block in self._blocks]
        pairs = (0, 1), (1, 0)
        self._words = [
            np.asarray([1, *(_address(self._states[k]) for k in pair), *fixed], np.uint64)
            for pair in pairs
        ]
        self._calls = [words.__array_interface__["data"][0] for words in self._words]
        self._function, self._now = program.function(), 0

    def __reduce__(self) -> Any:
        return _game_of, (self.program, self._states[self._now].tobytes())

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return type(self)(self.program)._with(self._states[self._now].tobytes())

    def _with(self, state: bytes) -> Self:
        self._states[self._now][:] = np.frombuffer(state, np.uint8)
        return self

    @property
    def state(self) -> Any:
        """The state of the game, as a copy."""
        return self.program.state.tree([view.copy() for view in self._views[self._now]])

    def begin(self, state: Any) -> None:
        """Go on from a state."""
        for view, leaf in zip(self._views[self._now], _arrays(state), strict=True):
            view[...] = leaf

    def play(self, *inputs: Any) -> Any:
        """Play one round.

        Args:
            *inputs: Inputs of the round, those that are keys last.

        Returns:
            What the round returns; its arrays are written to in the next round.
        """
        for view, given in zip((*self._inputs, *self._keys), inputs, strict=True):
            view[...] = given
        self._function(self._calls[self._now])
        self._now = 1 - self._now
        return self._outputs


def _game_of(program: Program, state: bytes) -> CompiledGame:
    return CompiledGame(program)._with(state)


class CompiledBatch:
    """A compiled round as a pure function, for batches of any number of games.

    Args:
        program: Compiled round of a batch.
    """

    def __init__(self, program: Program) -> None:
        self.program = program
        self._function = program.function()
        self._scratch = _block(program.scratch)
        self._made: tuple[Any, Memory | None] = (None, None)

    def __reduce__(self) -> Any:
        return CompiledBatch, (self.program,)

    def play(self, state: Any, *inputs: Any) -> tuple[Any, Any]:
        """Return the state after a round and what the round returns.

        Args:
            state: State of the games, whose arrays have the games last.
            *inputs: Inputs of the round, those that are keys last.
        """
        program = self.program
        many = len(program.inputs.arrays)
        games = int(_arrays(state)[0].shape[-1])
        room = max(games, program.width)
        before = self._made[1] if state is self._made[0] else None
        if before is None:
            before = _filled(program.state, _arrays(state), games, room)
        given = _filled(program.inputs, inputs[:many], games, room)
        keys = _filled(program.keys, inputs[many:], 1, 1)
        after, outputs = _block(program.state.size * room), _block(program.outputs.size * room)
        blocks = before, after, given, outputs, keys, self._scratch
        words = np.asarray([room, *map(_address, blocks)], np.uint64)
        self._function(_address(words))
        next_state = program.state.tree(_cut(program.state.views(after, (room,)), games))
        self._made = next_state, after if room == games else None
        return next_state, program.outputs.tree(_cut(program.outputs.views(outputs, (room,)), games))


def _filled(layout: Layout, parts: Any, games: int, room: int) -> Memory:
    """Return memory with arrays of so many games, and copies of the last one up to the room."""
    memory = _block(layout.size * room)
    for view, part in zip(layout.views(memory, (room,)), parts, strict=True):
        view[..., :games] = part if part.ndim == view.ndim else part[..., None]
        view[..., games:] = view[..., games - 1 : games]
    return memory


def _cut(views: list[npt.NDArray[Any]], games: int) -> list[npt.NDArray[Any]]:
    return [view[..., :games] for view in views]
