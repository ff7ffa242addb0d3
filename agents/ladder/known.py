"""Rungs that search nothing: honest play at the foot of the ladder, and saved attackers."""

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agents.ladder.players import Scripted
from agents.ladder.rungs import Arguments, Attempt, Tell, UnsuitableError, exact_task
from roletrust_env.arrays import Array
from roletrust_env.envs.attack import task_spaces
from roletrust_env.game.attack import AttackTask, Knowledge, TaskState
from roletrust_env.randomness import Random

if TYPE_CHECKING:
    from agents.learned.network import Network


@dataclass(frozen=True)
class HonestPlay:
    """The compromised agents do nothing wrong."""

    name: str = "honest play"

    def attack(self, arguments: Arguments, budget: int, seed: int, tell: Tell) -> Attempt:
        """See `Rung.attack`."""
        return Attempt(Scripted({}), 0, "serves its best, reports what it perceives")


@dataclass(frozen=True, eq=False)
class Mind:
    """A network that decides for all compromised agents, seeing what its knowledge lets it see."""

    network: "Network"
    knowledge: Knowledge

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, int]) -> Any:
        """See `Attacker.begin`."""
        return _knowing(task, self.knowledge), self.network.begin(np.zeros(batch))

    def act(self, task: AttackTask, state: TaskState, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Attacker.act`."""
        task, remembered = memory
        action, remembered = self.network(task.observe(state), remembered)
        return action, (task, remembered)


@dataclass(frozen=True)
class Learned:
    """A saved attacker, as `roletrust train` leaves it. Its rounds and seconds are those of its training.

    Attributes:
        path: of its folder, or of one of its two files.
        name: in tables.
    """

    path: Path
    name: str = "learned"

    def attack(self, arguments: Arguments, budget: int, seed: int, tell: Tell) -> Attempt:
        """See `Rung.attack`."""
        from agents.learned.saved import load_attacker

        saved = load_attacker(self.path)
        card, task = saved.card, exact_task(arguments)
        mind = Mind(saved.network, card.task.knowledge)
        seen, needed = _observation_size(_knowing(task, mind.knowledge)), card.architecture.inputs
        if (seen, task.action_size) != (needed, card.architecture.outputs):
            raise UnsuitableError(
                f"{self.path} learned with {needed} observations and {card.architecture.outputs} actions; "
                f"this task has {seen} and {task.action_size}"
            )
        words = f"{card.training.algorithm} on {card.task.id}, {card.task.knowledge}"
        return Attempt(mind, card.training.steps, words, card.training.seconds)


def _knowing(task: AttackTask, knowledge: Knowledge) -> AttackTask:
    """The same task, seen with another knowledge."""
    other = copy.copy(task)
    other.knowledge = knowledge
    return other


def _observation_size(task: AttackTask) -> int:
    return int(task_spaces(task)[0].shape[0])
