"""A batch of games of an attack task, which all environments of tasks play."""

from collections.abc import Callable
from functools import reduce
from operator import and_
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box

from roletrust_env.arrays import Array, all_within, library_of, namespace
from roletrust_env.envs.arguments import Engine, check_games, is_compiled, refuse_changeable
from roletrust_env.game.attack_task import AttackTask, Outcome, TaskState
from roletrust_env.game.state import State
from roletrust_env.randomness import Random
from roletrust_env.trees import map_leaves

if TYPE_CHECKING:
    from roletrust_env.compiled import CompiledBatch, CompiledGame, Program


def task_spaces(task: AttackTask) -> tuple[Box, Box]:
    """Return the observation space and the action space of one game of a task."""
    trial = TaskBatch(task)
    trial.restart(task.game.random(0))  # the shape does not depend on the seed
    seen = trial.observe().shape[0]
    return Box(*task.bounds, (seen,), np.float32), Box(0.0, 1.0, (task.action_size,), np.float32)


class TaskRound(NamedTuple):
    """What is known of a task after a round.

    Attributes:
        outcome: Outcome of the round.
        round: Number of rounds played, shape (...).
        observation: Observation of the attacker, shape (K, ...).
        valid: Whether the actions of policies lie in [0, 1], boolean, shape (...); None where that
            was checked before the round, or where there are no policies.
    """

    outcome: Outcome
    round: Array
    observation: Array
    valid: Array | None = None

    def checked(self) -> "TaskRound":
        """Return the round, if its actions are valid.

        Raises:
            ValueError: A policy has returned an action that is NaN or outside [0, 1].
        """
        if self.valid is not None and not self.valid.all():
            raise ValueError(
                f"round {int(self.round.reshape(-1)[0]) - 1}: an action of a policy is NaN or "
                "outside [0, 1]; engine='rules' names the agent"
            )
        return self


def compile_task(task: AttackTask) -> "CompiledGame":
    """Return the rounds of one game of a task in the compiled engine, see `record_task`."""
    from roletrust_env.compiled import CompiledGame

    return CompiledGame(record_task(task, batch=False))


def compile_batch(task: AttackTask) -> "CompiledBatch":
    """Return the rounds of a batch of a task in the compiled engine, see `record_task`."""
    from roletrust_env.compiled import CompiledBatch

    return CompiledBatch(record_task(task, batch=True))


def record_task(task: AttackTask, *, batch: bool) -> "Program":
    """Return the round of a task for the compiled engine.

    Args:
        task: Attack task on NumPy.
        batch: Whether it is for a batch of games.

    Raises:
        ValueError: The engine cannot play the task, or is not installed. The message says why.
    """
    from roletrust_env.compiled import Program

    def make(like: Array) -> Callable[..., tuple[TaskState, TaskRound]]:
        recorded = task.on_library(like)

        def play(
            state: TaskState, action: Array, key: Array, random: Random
        ) -> tuple[TaskState, TaskRound]:
            noise = recorded.game.noise(key, state.game.round.shape)
            actions, memories = recorded.joint(state, action, random)
            after, outcome = recorded.advance(state, actions, memories, noise)
            valid = None
            if recorded.joint_policy.policies:
                chosen = actions.quality, actions.ratings, actions.treatment, actions.claims
                valid = reduce(and_, (all_within(part) for part in chosen if part is not None))
            return after, TaskRound(outcome, after.game.round, recorded.observe(after), valid)

        return play

    refuse_changeable([task.game.model, *task.joint_policy.policies.values()])
    if not isinstance(task.game.like, np.ndarray):
        raise ValueError(
            f"engine 'compiled' needs a task on NumPy, got {library_of(task.game.like)}"
        )
    random = task.game.random(0)
    state = task.start(task.game.draw(random, start=True), random)
    action = np.zeros(task.action_size, task.game.like.dtype)
    return Program.record(make, state, (action, random.round_key()), batch=batch)


class TaskBatch:
    """Games of one task in progress.

    Args:
        task: Attack task.
        shape: Shape of the batch: `()` for one game, `(E,)` for E games.
        rounds: Length of an episode, if less than that of a game; None is a whole game.
        engine: `"rules"` or `"compiled"`, which needs a batch on NumPy.
        whole: Whether no game ends at random.

    Attributes:
        rounds: Greatest length of an episode.

    Raises:
        ValueError: The compiled engine cannot play the task.
    """

    def __init__(
        self,
        task: AttackTask,
        shape: tuple[int, ...] = (),
        rounds: int | None = None,
        engine: Engine = "rules",
        whole: bool = False,
    ) -> None:
        if shape:
            random = task.game.random(0)
            game = task.start(task.game.draw(random, start=True), random)
            check_games("num_envs", shape[0], (game, task.observe(game)))
        self.task = task
        self.shape = shape
        self.rounds = min(rounds or task.game.scenario.max_cycles, task.game.scenario.max_cycles)
        self.state: TaskState | None = None
        self._whole, self._end = whole, self.rounds + 1
        self._compiled = compile_batch(task) if is_compiled(engine) else None
        # A state, and what is observed then.
        self._observed: tuple[TaskState | None, Array] = (None, None)

    def restart(self, random: Random, ended: Array | None = None) -> None:
        """Restart all games, or only those that have ended, boolean, (E,)."""
        fresh = self.task.start(self.task.game.draw(random, self.shape, start=True), random)
        begun = fresh, self._end if self._whole else self.task.game.random_end(random, self.shape)
        self.state, self._end = (
            begun if ended is None else choose(ended, begun, (self.state, self._end))
        )

    def step(
        self, action: Array, random: Random, waiting: Array | None = None
    ) -> tuple[Outcome, Array, Array]:
        """Play one round of all games except those that wait, boolean, (E,); `action` has shape (A,
        ...).

        Returns:
            The outcome; whether an episode has terminated, as all compromised agents are gone or
            the game has ended at random; and whether it is truncated at its greatest length. They
            have no meaning for a game that waits.
        """
        if self.state is None:
            raise RuntimeError("call reset() before step(): there is no episode")
        if self._compiled is None:
            noise = self.task.game.draw(random, self.shape)
            after, outcome = self.task.step(self.state, action, noise, random)
        else:
            after, played = self._compiled.play(
                self.state, action, random.round_key(), random=random
            )
            outcome, _, observation, _ = played.checked()
            self._observed = after, observation
        self.state = after if waiting is None else choose(waiting, self.state, after)
        round = after.game.round
        terminated = outcome.caught | (round >= self._end)
        return outcome, terminated, (round >= self.rounds) & ~terminated

    def observe(self) -> Array:
        """Return the observation of the attacker, shape (K, ...)."""
        if self.state is None:
            raise RuntimeError("call reset() before observe(): there is no episode")
        state, observation = self._observed
        return observation if state is self.state else self.task.observe(self.state)

    @property
    def games(self) -> State:
        """The state of the games."""
        if self.state is None:
            raise RuntimeError("call reset() first: there is no episode")
        return self.state.game


def choose(condition: Array, yes: Any, no: Any) -> Any:
    """Choose between two trees of the same structure, by game."""
    xp = namespace(condition)
    return map_leaves(lambda one, other: xp.where(condition, one, other), yes, no)
