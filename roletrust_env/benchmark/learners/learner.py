"""Learners that others write: what they are given, what they give back, and how that plays in the game.

A learner is a class that needs no more than this file's `Learner` says; it is named as `package.module:Class`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from roletrust_env.arrays import Array
from roletrust_env.envs.attack_env import check_action
from roletrust_env.envs.vector import AttackVectorEnv
from roletrust_env.evaluation.attacked_games import TaskArguments
from roletrust_env.evaluation.search import Budget, SearchResult
from roletrust_env.game.attack_task import AttackTask, TaskState
from roletrust_env.randomness import Random
from roletrust_env.registry import Registry

GAMES = 32
"""Games side by side, for a learner that does not say how many."""

Floats = npt.NDArray[np.float32]
Play = Callable[[Floats], Floats]
"""A policy: observations (G, K) to actions (G, A), in [0, 1], as Gymnasium has them.

One that remembers is an object with a method `begin(games)` besides, which is called before the first round of a batch
of games and must forget all that was before.
"""


@runtime_checkable
class Learner(Protocol):
    """What learns to attack. One object learns once.

    An attribute `games`, where there is one, is the number of games that it wants side by side; else there are `GAMES`.
    """

    def learn(self, env: VectorEnv[Any, Any, Any], budget: int, seed: int) -> Play:
        """Learn.

        Args:
            env: games of a task, which begin anew in the same step in which they end. Every step is a round of each of
                its E games, and takes E rounds of the budget.
            budget: rounds x games that may be played; a step beyond it raises `SpentError`.
            seed: of all that the learner draws itself; the games have theirs already.

        Returns:
            What it plays at last, without exploring.
        """
        ...


registry: Registry[Learner] = Registry("learner", "roletrust_env.learners", Learner)


def register_learner(name: str, factory: Callable[..., Learner]) -> None:
    """Register a learner under a name.

    Args:
        name: New name.
        factory: Callable `(**parameters) -> Learner`, usually the learner's class.

    Raises:
        ValueError: The name is taken or is not a word.
    """
    registry.register(name, factory)


class SpentError(ValueError):
    """A step was asked for beyond the budget."""


class CountedGames(VectorWrapper[Any, Any, Any, Any, Any]):
    """Games that count their rounds, and refuse those beyond a budget.

    Args:
        env: games that begin anew in the step in which they end.
        budget: Budget in game rounds.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], budget: Budget) -> None:
        super().__init__(env)
        self._budget = budget

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Play one round of all games. See `gymnasium.vector.VectorEnv.step`.

        Raises:
            SpentError: the budget does not hold so many more rounds. Nothing has changed then.
        """
        if self.num_envs > self._budget.left:
            raise SpentError(
                f"{self._budget.left} of {self._budget.rounds} rounds are left, and a step of {self.num_envs} games "
                "needs more"
            )
        stepped = self.env.step(actions)
        self._budget.spend(self.num_envs)
        return stepped


@dataclass(frozen=True)
class Entered:
    """A learner of somebody's own as a rung of the ladder.

    Attributes:
        learner: that learns.
        name: in tables.
        task_id: that it learns on, one of `TASKS`.
    """

    learner: Learner
    name: str
    task_id: str

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        number = getattr(self.learner, "games", GAMES)
        games = AttackVectorEnv(self.task_id, number, autoreset_mode=AutoresetMode.SAME_STEP, **arguments)
        games.reset(seed=seed)  # a later reset without a seed goes on from here
        play = self.learner.learn(CountedGames(games, budget), budget.rounds, seed)
        if not callable(play):
            raise ValueError(f"learn() of {self.name} gave {play!r}; it must give what plays, see Learner")
        return SearchResult(Taught(play), budget.spent, f"{self.name} in {budget.spent} rounds")


@dataclass(frozen=True, eq=False)
class Taught:
    """What a learner came up with, as an attacker. It sees what it saw while it learned."""

    play: Play

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, ...]) -> None:
        """See `Attacker.begin`."""
        if callable(begin := getattr(self.play, "begin", None)):
            begin(prod(batch))

    def act(self, task: AttackTask, state: TaskState, memory: None, random: Random) -> tuple[Array, None]:
        """See `Attacker.act`."""
        seen = task.observe(state)
        batch = seen.shape[1:]
        rows = np.ascontiguousarray(seen.reshape(len(seen), -1).T, np.float32)
        actions = check_action(self.play(rows), (len(rows), task.action_size))
        return actions.T.reshape(task.action_size, *batch).astype(seen.dtype), None
