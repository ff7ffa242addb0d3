"""Compiled rounds: a round of the rules is recorded once, compiled, and played from then on."""

import math
import sys
from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array
from roletrust_env.compiled.emit import Place, emit
from roletrust_env.compiled.library import Function, load
from roletrust_env.compiled.record import Recorded, UnrecordableError, constant, make_input
from roletrust_env.compiled.schedule import Put
from roletrust_env.randomness import Random
from roletrust_env.trees import arrays, map_leaves

Memory = npt.NDArray[np.uint8]
Play = Callable[..., tuple[Any, Any]]
"""A round, see `Program.record`."""


class Layout:
    """The places of the arrays of a tree in a block of memory.

    Args:
        tree: Arrays of one game.

    Attributes:
        arrays: Shape in one game, dtype and number of bytes before it of each array.
        size: Number of bytes of one game.
    """

    def __init__(self, tree: Any) -> None:
        self._tree = map_leaves(lambda _: True, tree)
        parts = [leaf if isinstance(leaf, Recorded) else np.asarray(leaf) for leaf in arrays(tree)]
        # The longest numbers first, so that all are aligned for any number of games.
        starts, self.size = dict[int, int](), 0
        for k in sorted(range(len(parts)), key=lambda k: -parts[k].dtype.itemsize):
            starts[k] = self.size
            self.size += parts[k].size * parts[k].dtype.itemsize
        self.arrays = [(a.shape, a.dtype, starts[k]) for k, a in enumerate(parts)]

    def symbols(self, name: str) -> list[Recorded]:
        """Return an input for each array."""
        return [
            make_input(f"{name} {k}", shape, dtype)
            for k, (shape, dtype, _) in enumerate(self.arrays)
        ]

    def tree(self, parts: Any) -> Any:
        """Return a tree of this structure with other arrays, in order."""
        rest = iter(parts)
        return map_leaves(lambda _: next(rest), self._tree)

    def views(self, memory: Memory, games: tuple[int, ...] = ()) -> list[npt.NDArray[Any]]:
        """Return the arrays in a block of memory, for a batch of this shape."""
        many = math.prod(games)
        return [
            np.ndarray((*shape, *games), dtype, memory.data, start * many)
            for shape, dtype, start in self.arrays
        ]


class RecordedRandom(Random):
    """Random numbers of policies, made from keys that are known only when a round is played.

    Args:
        like: Array of the game.
        game: Index of the game in its batch.

    Attributes:
        keys: An input for each draw so far.
    """

    def __init__(self, like: Recorded, game: Recorded) -> None:
        self.like, self._game, self.keys = like, game, list[Recorded]()

    def policy_key(self) -> Array:
        """Return the key of the next draw. See `Random.policy_key`."""
        self.keys.append(make_input(f"policies {len(self.keys)}", (4,), np.int32))
        return _of_game(self.keys[-1], self._game)[:, None]


def _of_game(key: Array, game: Recorded) -> Array:
    """Return the key of a game: the second of four words counts the games."""
    return key + game * np.asarray([0, 1, 0, 0], np.int32)


class Program(NamedTuple):
    """A recorded round, as source.

    Attributes:
        state: Layout of the state.
        inputs: Layout of the inputs of each game.
        keys: Layout of the keys, which are the same for all games: those given, then those of
            policies.
        outputs: Layout of what a round returns.
        draws: Number of draws of policies in a round.
        source: Source of the round, in the language of LLVM.
        scratch: Number of bytes of scratch memory.
        width: Number of games that are played at once.
    """

    state: Layout
    inputs: Layout
    keys: Layout
    outputs: Layout
    draws: int
    source: str
    scratch: int
    width: int

    @classmethod
    def record(
        cls,
        make: Callable[[Recorded], Play],
        state: Any,
        inputs: tuple[Any, ...],
        *,
        keys: int = 1,
        batch: bool = False,
    ) -> "Program":
        """Record a round.

        Args:
            make: Function that makes a game for an array of its library, and returns its round:
                a pure function of the state, the inputs and the random numbers of policies, which
                returns the next state and a tree of whatever else is wanted.
            state: Example of a state of one game, on NumPy.
            inputs: Example of the inputs for one game.
            keys: Number of inputs at the end that are keys, see `Random.round_key`: words of shape
                (..., 4), the same for all games.
            batch: Whether the program is for batches.

        Raises:
            UnrecordableError: A rule cannot be recorded.
        """
        before, given = Layout(state), Layout(inputs[: len(inputs) - keys])
        of_keys = [np.asarray(key) for key in inputs[len(inputs) - keys :]]
        dtypes = {dtype for _, dtype, _ in before.arrays if dtype.kind == "f"}
        like = constant(np.zeros((), np.result_type(*dtypes)))
        game = make_input("game", (), np.int32)
        random = RecordedRandom(like, game)
        symbols, parameters = before.symbols("state"), given.symbols("input")
        words = [make_input(f"key {k}", key.shape, np.int32) for k, key in enumerate(of_keys)]
        try:
            after, outputs = make(like)(
                before.tree(symbols),
                *given.tree(parameters),
                *(_of_game(key, game) for key in words),
                random,
            )
        except ValueError as error:  # an operation that cannot be recorded, or a game for NumPy
            raise UnrecordableError(_refusal(error)) from error
        except Exception as error:  # a part of another package may raise anything
            reason = f"{type(error).__name__}: {error}"
            raise UnrecordableError(_refusal(reason)) from error
        after, outputs = map_leaves(constant, after), map_leaves(constant, outputs)
        shapes = [(leaf.shape, leaf.dtype.kind) for leaf in arrays(after)]
        if shapes != [(shape, dtype.kind) for shape, dtype, _ in before.arrays]:
            raise UnrecordableError(_refusal("a round changes the structure of the state"))
        results = Layout(outputs)
        all_keys = Layout(tuple(np.empty(key.shape, np.uint32) for key in [*words, *random.keys]))
        places = {game: Place("games", 0, game.dtype)}
        for block, layout, nodes in (
            ("before", before, symbols),
            ("inputs", given, parameters),
            ("shared", all_keys, [*words, *random.keys]),
        ):
            for node, (_, _, start) in zip(nodes, layout.arrays, strict=True):
                places[node] = Place(block, start, node.dtype)
        puts = [
            Put(leaf, Place(block, start, dtype), np.arange(leaf.size).reshape(leaf.shape))
            for block, layout, tree in (("after", before, after), ("outputs", results, outputs))
            for leaf, (_, dtype, start) in zip(arrays(tree), layout.arrays, strict=True)
        ]
        width = 1 if not batch else 8 if like.dtype == np.float64 else 16
        code = emit(places, puts, width)
        return cls(before, given, all_keys, results, len(random.keys), *code, width)

    def function(self) -> Function:
        """Return the compiled function."""
        return load(self.source)

    def policy_keys(self, random: Random | None) -> list[Array]:
        """Return the keys of the draws of policies in the next round."""
        if not self.draws:
            return []
        assert random is not None  # the policies draw from it
        return [random.policy_key()[:, 0] for _ in range(self.draws)]


def _refusal(reason: object) -> str:
    return f'engine "compiled" cannot play this game: {reason}'


def _block(size: int) -> Memory:
    """Return memory that begins where a line of the cache does."""
    memory = np.empty(size + 64, np.uint8)
    start = -_address(memory) % 64
    return memory[start : start + size]


def _address(memory: npt.NDArray[Any]) -> int:
    address: int = memory.__array_interface__["data"][0]
    return address


class CompiledGame:
    """One game in progress, played by a compiled round.

    Args:
        program: Compiled round of one game.

    Example:
        >>> from roletrust_env import Game, make_scenario
        >>> from roletrust_env.game.state import Actions
        >>> scenario = make_scenario("paper-3x3")
        >>> def make(like):
        ...     game = Game(scenario, like=like)
        ...     def play(state, quality, ratings, key, random):
        ...         after, rewards = game.step(state, Actions(quality, ratings), game.noise(key))
        ...         return after, (rewards,)
        ...     return play
        >>> game = Game(scenario)
        >>> random = game.random(seed=0)
        >>> state = game.start(game.draw(random, start=True))
        >>> example = state.quality, state.ratings, random.round_key()
        >>> compiled = CompiledGame(Program.record(make, state, example))
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
        self._parameters = program.inputs.views(inputs) + program.keys.views(keys)
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
        for view, leaf in zip(self._views[self._now], arrays(state), strict=True):
            view[...] = leaf

    def play(self, *inputs: Any, random: Random | None = None) -> Any:
        """Play one round.

        Args:
            *inputs: Inputs of the round.
            random: Random numbers of policies that draw some.

        Returns:
            What the round returns; its arrays are written to in the next round.
        """
        if self.program.draws:
            inputs = (*inputs, *self.program.policy_keys(random))
        for view, given in zip(self._parameters, inputs, strict=True):
            view[...] = given
        self._function(self._calls[self._now])
        self._now = 1 - self._now
        return self._outputs


def _game_of(program: Program, state: bytes) -> CompiledGame:
    return CompiledGame(program)._with(state)


_MOST_BLOCKS = 6
_UNUSED = 2  # references to memory: the block, and the call that counts


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
        self._blocks: list[Memory] = []

    def __reduce__(self) -> Any:
        return CompiledBatch, (self.program,)

    def play(self, state: Any, *inputs: Any, random: Random | None = None) -> tuple[Any, Any]:
        """Return the state after a round and what the round returns.

        Args:
            state: State of the games, whose arrays have the games last.
            *inputs: Inputs of the round.
            random: Random numbers of policies that draw some.
        """
        program = self.program
        inputs = (*inputs, *program.policy_keys(random))
        many = len(program.inputs.arrays)
        games = int(arrays(state)[0].shape[-1])
        room = max(games, program.width)
        before = self._made[1] if state is self._made[0] else None
        if before is None:
            before = _filled(program.state, arrays(state), games, room)
        given = _filled(program.inputs, inputs[:many], games, room)
        keys = _filled(program.keys, inputs[many:], 1, 1)
        after, outputs = (
            self._memory(layout.size * room) for layout in (program.state, program.outputs)
        )
        blocks = before, after, given, outputs, keys, self._scratch
        words = np.asarray([room, *map(_address, blocks)], np.uint64)
        self._function(_address(words))
        next_state = program.state.tree(_cut(program.state.views(after, (room,)), games))
        self._made = next_state, after if room == games else None
        return next_state, program.outputs.tree(
            _cut(program.outputs.views(outputs, (room,)), games)
        )

    def _memory(self, size: int) -> Memory:
        """Return memory for results: that of earlier ones, once nobody has them any more.

        The system would clear large new memory first, which takes as long as a round.
        """
        for block in self._blocks:
            if len(block) == size and sys.getrefcount(block.base) == _UNUSED:
                return block
        self._blocks = [*self._blocks[1 - _MOST_BLOCKS :], _block(size)]
        return self._blocks[-1]


def _filled(layout: Layout, parts: Any, games: int, room: int) -> Memory:
    """Return memory with arrays of so many games, and copies of the last one up to the room."""
    memory = _block(layout.size * room)
    for view, part in zip(layout.views(memory, (room,)), parts, strict=True):
        view[..., :games] = part if part.ndim == view.ndim else part[..., None]
        view[..., games:] = view[..., games - 1 : games]
    return memory


def _cut(views: list[npt.NDArray[Any]], games: int) -> list[npt.NDArray[Any]]:
    return [view[..., :games] for view in views]
