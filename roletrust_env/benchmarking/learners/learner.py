"""Plug-in learners: their interface, the attackers that they train, and search methods by name
beside them.

A learner is a class that implements `Learner`. Its spec is a registered name or
`package.module:Class`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from roletrust_env.arrays import Array
from roletrust_env.envs.actions import check_action
from roletrust_env.envs.vector import AttackVectorEnv
from roletrust_env.errors import suggest
from roletrust_env.evaluation.measurement import TaskArguments
from roletrust_env.evaluation.search import (
    Budget,
    HonestPlay,
    SearchMethod,
    SearchResult,
    bounds,
    search_methods,
)
from roletrust_env.evaluation.specs import parse_named
from roletrust_env.game.attack_task import AttackTask, TaskState
from roletrust_env.randomness import Random
from roletrust_env.registry import Registry, parse_entry

HONEST_PLAY = "honest play"
"""Name of the reference whose share of the optimum is 0."""

GAMES = 32
"""Default number of parallel games of a learner."""

Floats = npt.NDArray[np.float32]
PolicyFunction = Callable[[Floats], Floats]
"""Policy that maps observations (G, K) to actions (G, A) in [0, 1], in the layout of Gymnasium.

A policy with a memory is an object with an additional method `begin(games)`. It is called before
the first round of a batch of games and must reset the memory.
"""


@runtime_checkable
class Learner(Protocol):
    """Learner of an attack. Each object learns once.

    The optional attribute `games` is the number of parallel games. The default is `GAMES`.
    """

    def learn(self, env: VectorEnv[Any, Any, Any], budget: int, seed: int) -> PolicyFunction:
        """Learn a policy.

        Args:
            env: Parallel games of a task. A game restarts in the same step in which it ends. A step
                plays one round of each of the E games and uses E rounds of the budget.
            budget: Budget in game rounds (rounds x games). A step beyond it raises
                `BudgetSpentError`.
            seed: Random seed of the learner. The games are seeded already.

        Returns:
            Final policy without exploration.
        """


registry: Registry[Learner] = Registry("learner", "roletrust_env.learners", Learner)


register_learner = registry.register
"""Register the class of a learner under a name, see `Registry.register`."""


class BudgetSpentError(ValueError):
    """A step exceeds the budget."""


class CountedGames(VectorWrapper):  # not generic before Gymnasium 1.4
    """Parallel games that count their rounds and raise an error beyond a budget.

    Args:
        env: Parallel games. A game restarts in the same step in which it ends.
        budget: Budget in game rounds.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], budget: Budget) -> None:
        super().__init__(env)
        self._budget = budget

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Play one round of all games. See `gymnasium.vector.VectorEnv.step`.

        Raises:
            BudgetSpentError: The step needs more rounds than the budget has left. The games are
                unchanged.
        """
        if self.num_envs > self._budget.left:
            raise BudgetSpentError(
                f"{self._budget.left} of {self._budget.rounds} rounds are left, and a step of "
                f"{self.num_envs} games "
                "needs more"
            )
        stepped = self.env.step(actions)
        self._budget.spend(self.num_envs)
        return stepped


@dataclass(frozen=True)
class LearnerTraining:
    """Search method that trains a learner.

    Attributes:
        learner: Learner to train.
        name: Name of the learner in tables.
        task_id: Gymnasium id of the task, one of `TASKS`.
    """

    learner: Learner
    name: str
    task_id: str

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        number = getattr(self.learner, "games", GAMES)
        games = AttackVectorEnv(
            self.task_id, number, autoreset_mode=AutoresetMode.SAME_STEP, **arguments
        )
        games.reset(seed=seed)  # later resets without a seed continue this random stream
        play = self.learner.learn(CountedGames(games, budget), budget.rounds, seed)
        if not callable(play):
            raise ValueError(
                f"learn() of {self.name} returned {play!r}; it must return a policy, see Learner"
            )
        return SearchResult(
            LearnedAttacker(play), budget.spent, f"{self.name} in {budget.spent} rounds"
        )


@dataclass(frozen=True, eq=False)
class LearnedAttacker:
    """Attacker that plays the policy of a learner, with the same observations as in training."""

    play: PolicyFunction

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, ...]) -> None:
        """See `Attacker.begin`."""
        if callable(begin := getattr(self.play, "begin", None)):
            begin(prod(batch))

    def act(
        self, task: AttackTask, state: TaskState, memory: None, random: Random
    ) -> tuple[Array, None]:
        """See `Attacker.act`."""
        observations = task.observe(state)
        batch = observations.shape[1:]
        rows = np.ascontiguousarray(observations.reshape(len(observations), -1).T, np.float32)
        actions = check_action(self.play(rows), (len(rows), task.action_size))
        return actions.T.reshape(task.action_size, *batch).astype(observations.dtype), None


def is_search(name: str) -> bool:
    """Return whether the name of a learner is that of a search method, with parameters or without;
    a `package.module:Class` is imported.

    Raises:
        ValueError: There is no such class.
    """
    if name.partition(":")[0] in search_methods.names():
        return True
    own = ":" in name and name.partition(":")[0] not in registry.names()
    return own and callable(getattr(_class_of(name), "search", None))


def _class_of(name: str) -> Any:
    """Return the class `package.module:Class[:key=value,...]`."""
    entry, own, _ = parse_entry(Registry("learner", registry.group, object), name)
    return entry.factory(own)


def make_search_method(name: str, task_id: str) -> SearchMethod:
    """Return a search method for a task.

    Args:
        name: `HONEST_PLAY`, that of a bound, of a search method, or of a learner: an installed one,
            or `package.module:Class`. Search methods and learners may have parameters, as in
            `NAME:key=value,...`.
        task_id: Gymnasium id of the task, one of `TASKS`.

    Raises:
        ValueError: The name is unknown, or the learner cannot be created.
    """
    if name == HONEST_PLAY:
        return HonestPlay()
    if name in bounds.names():
        return bounds.make(name)
    if is_search(name):
        return parse_named(search_methods, name)
    if ":" not in name and name not in registry.names():
        known = suggest(name, [*search_methods.names(), *registry.names()])
        raise ValueError(f"unknown learner {name!r}{known}, or your own package.module:Class")
    return LearnerTraining(parse_named(registry, name), name, task_id)
