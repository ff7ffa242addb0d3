"""Compiled rounds: a round of the rules is recorded once, compiled, and played from then on."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from roletrust_env import counter_rng
from roletrust_env.arrays import Array
from roletrust_env.compiled.emit import ALIGNMENT, emit
from roletrust_env.compiled.library import Function, load
from roletrust_env.compiled.record import (
    Recorded,
    Shape,
    UnrecordableError,
    constant,
    make_input,
    to_dtype,
)
from roletrust_env.randomness import Random
from roletrust_env.trees import arrays, map_leaves

Facts: TypeAlias = tuple[Shape, Any]
"""Shape in one game and dtype of an array."""

Play = Callable[..., tuple[Any, Any]]
"""A round, see `Program.record`."""


class Layout:
    """The structure of a tree of arrays.

    Args:
        tree: Arrays of one game.

    Attributes:
        arrays: Shape in one game and dtype of each array.
    """

    def __init__(self, tree: Any) -> None:
        self._tree = map_leaves(lambda _: True, tree)
        self.arrays: list[Facts] = [
            (leaf.shape, leaf.dtype) for leaf in map(constant, arrays(tree))
        ]

    def inputs(self, name: str) -> Any:
        """Return a tree of inputs."""
        return self.tree(
            make_input("input", f"{name} {k}", shape, dtype)
            for k, (shape, dtype) in enumerate(self.arrays)
        )

    def tree(self, parts: Any) -> Any:
        """Return a tree of this structure with other arrays, in order."""
        rest = iter(parts)
        return map_leaves(lambda _: next(rest), self._tree)


class RecordedRandom(Random):
    """Random numbers of policies, made from keys that are known only when a round is played.

    Args:
        like: Array of the game.

    Attributes:
        keys: An input for each key so far.
        games: Input for the number of games in the batch.
        counts_games: Whether a number depends on it, as where several agents share a policy.
    """

    def __init__(self, like: Recorded) -> None:
        self.like, self.keys = like, list[Recorded]()
        self.games = make_input("key", "games", (), np.int32)
        self.counts_games = False

    def key(self, shape: tuple[int, ...]) -> Array:
        """Return a key of a game: the second of four words counts the games."""
        self.keys.append(make_input("key", f"key {len(self.keys)}", shape, np.int32))
        game = make_input("game", "", (), np.int32)
        return self.keys[-1] + game * np.asarray([0, 1, 0, 0], np.int32)

    def policy_key(self) -> Array:
        """Return the key of the next draw. See `Random.policy_key`."""
        return self.key((4,))[:, None]

    def _numbers(self, distribution: Callable[..., Array], shape: Sequence[int]) -> Array:
        key, agents = self.policy_key(), math.prod(shape[1:])
        places = counter_rng.counters(self.like, agents)
        if agents > 1:  # all games of the first agent come before those of the next one
            self.counts_games = True
            places = places * self.games
        return distribution(self.like, shape[0], places, key).reshape(tuple(shape))


class Program(NamedTuple):
    """A recorded round, as source.

    Attributes:
        state: Layout of the state.
        inputs: Layout of the inputs of each game.
        keys: Layout of the keys, which are the same for all games: that of the round, then those of
            policies, and the number of games if numbers of policies depend on it.
        draws: Number of keys of policies.
        outputs: Layout of what a round returns.
        source: Source of the round, in the language of LLVM.
        width: Number of games that are played at once.
    """

    state: Layout
    inputs: Layout
    keys: Layout
    draws: int
    outputs: Layout
    source: str
    width: int

    @classmethod
    def record(
        cls,
        make: Callable[[Recorded], Play],
        state: Any,
        inputs: tuple[Any, ...],
        *,
        batch: bool = False,
    ) -> "Program":
        """Record a round.

        Args:
            make: Function that makes a game for an array of its library, and returns its round:
                a pure function of the state, the inputs and the random numbers of policies, which
                returns the next state and a tree of whatever else is wanted.
            state: Example of a state of one game, on NumPy.
            inputs: Example of the inputs for one game. The last one is a key, see
                `Random.round_key`, which is the same for all games.
            batch: Whether the program is for batches.

        Raises:
            UnrecordableError: A rule cannot be recorded.
        """
        *given, key = inputs
        before, parameters = Layout(state), Layout(tuple(given))
        like = constant(
            np.zeros((), np.result_type(*(d for _, d in before.arrays if d.kind == "f")))
        )
        random = RecordedRandom(like)
        symbols, examples = before.inputs("state"), parameters.inputs("input")
        try:
            after, outputs = make(like)(symbols, *examples, random.key(np.shape(key)), random)
            after, outputs = map_leaves(constant, after), map_leaves(constant, outputs)
            results = Layout(outputs)
        except ValueError as error:  # an operation that cannot be recorded, or a game for NumPy
            raise _refusal(error) from error
        except Exception as error:  # a part of another package may raise anything
            raise _refusal(f"{type(error).__name__}: {error}") from error
        structures = [
            [(shape, dtype.kind) for shape, dtype in layout.arrays]
            for layout in (before, Layout(after))
        ]
        if structures[0] != structures[1]:
            wider = _in_shapes(state, [shape for shape, _ in structures[1]])
            if wider is None:
                raise _refusal("a round changes the structure of the state")
            return cls.record(make, wider, inputs, batch=batch)
        next_state = [
            to_dtype(leaf, dtype)
            for leaf, (_, dtype) in zip(arrays(after), before.arrays, strict=True)
        ]
        width = 1 if not batch else 64 // like.dtype.itemsize
        keys = (*random.keys, *([random.games] if random.counts_games else ()))
        source = emit([*arrays(symbols), *examples, *keys], [*next_state, *arrays(outputs)], width)
        draws = len(random.keys) - 1
        return cls(before, parameters, Layout(keys), draws, results, source, width)

    def function(self) -> Function:
        """Return the compiled function."""
        return load(self.source)

    def with_draws(
        self, inputs: tuple[Any, ...], random: Random | None, games: int
    ) -> tuple[Any, ...]:
        """Return the inputs of a round and the keys that policies draw in it."""
        if not self.draws:
            return inputs
        assert random is not None  # the policies draw from it
        keys = [random.policy_key()[:, 0] for _ in range(self.draws)]
        counts = [np.int32(games)] * (len(self.keys.arrays) - 1 - self.draws)
        return *inputs, *keys, *counts


def _refusal(reason: object) -> UnrecordableError:
    return UnrecordableError(f'engine "compiled" cannot play this game: {reason}')


def _in_shapes(state: Any, shapes: Sequence[Shape]) -> Any:
    """Return a state whose arrays are broadcast to larger shapes, as a memory may begin with one
    row for all agents; None if that does not change it, or cannot be.
    """
    leaves = list(map(np.asarray, arrays(state)))
    try:
        wider = [np.broadcast_to(*each) for each in zip(leaves, shapes, strict=True)]
    except ValueError:
        return None
    if all(leaf.shape == other.shape for leaf, other in zip(leaves, wider, strict=True)):
        return None
    return Layout(state).tree(wider)


def _memory(facts: Sequence[Facts], *games: int) -> list[npt.NDArray[Any]]:
    """Return new arrays for a batch of this shape, which begin where a line of the cache does."""
    made = []
    for shape, dtype in facts:
        whole = (*shape, *games)
        block = np.empty(math.prod(whole) * dtype.itemsize + ALIGNMENT, np.uint8)
        made.append(np.ndarray(whole, dtype, block.data, -_address(block) % ALIGNMENT))
    return made


def _address(array: npt.NDArray[Any]) -> int:
    address: int = array.__array_interface__["data"][0]
    return address


def _words(games: int, memory: Sequence[npt.NDArray[Any]]) -> npt.NDArray[np.uint64]:
    """Return the arguments of a compiled function."""
    return np.asarray([games, *map(_address, memory)], np.uint64)


class CompiledGame:
    """One game in progress, played by a compiled round.

    Args:
        program: Compiled round of one game.
        state: State to go on from.

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

    def __init__(self, program: Program, state: Any = None) -> None:
        self.program, self._function = program, program.function()
        # The state, and the next one; a round swaps them.
        self._states = [_memory(program.state.arrays) for _ in range(2)]
        self._inputs = _memory([*program.inputs.arrays, *program.keys.arrays])
        outputs = _memory(program.outputs.arrays)
        self._outputs = program.outputs.tree(outputs)
        self._words = [
            _words(1, [*before, *self._inputs, *after, *outputs])
            for before, after in (self._states, self._states[::-1])
        ]
        self._calls = [_address(words) for words in self._words]
        if state is not None:
            self.begin(state)

    def __reduce__(self) -> Any:
        return CompiledGame, (self.program, self.state)

    @property
    def state(self) -> Any:
        """The state of the game, as a copy."""
        return self.program.state.tree([leaf.copy() for leaf in self._states[0]])

    def begin(self, state: Any) -> None:
        """Go on from a state."""
        for leaf, given in zip(self._states[0], arrays(state), strict=True):
            leaf[...] = given

    def play(self, *inputs: Any, random: Random | None = None) -> Any:
        """Play one round.

        Args:
            *inputs: Inputs of the round, and its key.
            random: Random numbers of policies that draw some.

        Returns:
            What the round returns; its arrays are written to in the next round.
        """
        given = self.program.with_draws(inputs, random, 1)
        for memory, value in zip(self._inputs, given, strict=True):
            memory[...] = value
        self._function(self._calls[0])
        self._states.reverse()
        self._calls.reverse()
        return self._outputs


class CompiledBatch:
    """A compiled round as a pure function, for batches of any number of games.

    Args:
        program: Compiled round of a batch.
    """

    def __init__(self, program: Program) -> None:
        self.program, self._function = program, program.function()

    def __reduce__(self) -> Any:
        return CompiledBatch, (self.program,)

    def play(self, state: Any, *inputs: Any, random: Random | None = None) -> tuple[Any, Any]:
        """Return the state after a round and what the round returns.

        Args:
            state: State of the games, whose arrays have the games last.
            *inputs: Inputs of the round, and its key.
            random: Random numbers of policies that draw some.
        """
        program = self.program
        games = arrays(state)[0].shape[-1]
        room = max(games, program.width)
        given = [*arrays(state), *program.with_draws(inputs, random, games)]
        facts = [*program.state.arrays, *program.inputs.arrays]
        before = [_spread(*each, room) for each in zip(given, facts, strict=False)]
        keys = [np.ascontiguousarray(key, np.uint32) for key in given[len(facts) :]]
        made = _memory([*program.state.arrays, *program.outputs.arrays], room)
        words = _words(room, [*before, *keys, *made])
        self._function(_address(words))
        parts = (leaf[..., :games] for leaf in made)
        return program.state.tree(parts), program.outputs.tree(parts)


def _spread(value: Any, facts: Facts, room: int) -> npt.NDArray[Any]:
    """Return an array of games in one piece; more copies of the last game fill the room."""
    shape, dtype = facts
    value = np.asarray(value, dtype)
    if value.ndim == len(shape):
        value = value[..., None]
    if value.shape[:-1] != shape:  # a memory that begins with one row for all agents
        value = np.broadcast_to(value, (*shape, value.shape[-1]))
    if value.shape[-1] != room:
        value = value[..., np.minimum(np.arange(room), value.shape[-1] - 1)]
    return np.ascontiguousarray(value)
