"""A batch of games of an attack task: the state behind every environment of a task."""

from collections.abc import Callable
from typing import Any

from array_api_compat import to_device

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.attack_task import AttackTask, Outcome, TaskState
from roletrust_env.game.state import State
from roletrust_env.randomness import Random
from roletrust_env.trees import is_array, map_leaves


class TaskBatch:
    """Games of one task in progress.

    Args:
        task: Attack task.
        shape: Shape of the batch: `()` for one game, `(E,)` for E games.
        rounds: Length of an episode, if less than that of a game; None is a whole game.

    Attributes:
        rounds: Length of an episode.
    """

    def __init__(self, task: AttackTask, shape: tuple[int, ...] = (), rounds: int | None = None) -> None:
        self.task = task
        self.shape = shape
        self.rounds = min(rounds or task.game.scenario.max_cycles, task.game.scenario.max_cycles)
        self.state: TaskState | None = None

    def restart(self, random: Random, ended: Array | None = None) -> None:
        """Restart all games, or only those that have ended, boolean, (E,)."""
        fresh = self.task.start(self.task.game.draw(random, self.shape, start=True), random)
        self.state = fresh if ended is None else _choose(ended, fresh, self.state)

    def step(self, action: Array, random: Random, waiting: Array | None = None) -> Outcome:
        """Play one round of all games except those that wait, boolean, (E,); `action` has shape (A, ...).

        The outcome has no meaning for a game that waits.
        """
        if self.state is None:
            raise RuntimeError("call reset() before step(): there is no episode")
        noise = self.task.game.draw(random, self.shape)
        after, outcome = self.task.step(self.state, action, noise, random)
        self.state = after if waiting is None else _choose(waiting, self.state, after)
        if self.rounds < self.task.game.scenario.max_cycles:
            outcome = outcome._replace(over=after.game.round >= self.rounds)
        return outcome

    def observe(self) -> Array:
        """Return the observation of the attacker, shape (K, ...)."""
        if self.state is None:
            raise RuntimeError("call reset() before observe(): there is no episode")
        return self.task.observe(self.state)

    @property
    def games(self) -> State:
        """The state of the games."""
        if self.state is None:
            raise RuntimeError("call reset() first: there is no episode")
        return self.state.game


def first_game(state: State) -> State:
    """Return the state of the first game of a batch, (E,), on the CPU; a single game's state is returned as it is."""
    return one_game(state, (0,)) if state.round.ndim else state


def one_game(state: State, place: tuple[int, ...]) -> State:
    """Return the state of one game of a batch, on the CPU.

    Args:
        state: State of a batch.
        place: Index of the game along the axes of the batch.
    """
    one: State = _map(lambda leaf: to_device(leaf[..., *place], "cpu"), state)
    return one


def _choose(condition: Array, yes: Any, no: Any) -> Any:
    """Choose between two trees of the same structure, by game."""
    xp = namespace(condition)
    return _map(lambda a, b: xp.where(condition, a, b), yes, no)


def _map(change: Callable[..., Array], *states: Any) -> Any:
    """Apply a function to the arrays of states; a flag must hold in all of them to hold in the result."""
    return map_leaves(lambda *same: change(*same) if is_array(same[0]) else same[0] and same[-1], *states)
