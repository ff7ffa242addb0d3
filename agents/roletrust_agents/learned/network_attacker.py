"""A network or a model as an attacker: it decides for all compromised agents at once."""

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from roletrust_agents.learned.network import Decider
from roletrust_env.arrays import Array, cast
from roletrust_env.game.attack_task import AttackTask, Knowledge, TaskState
from roletrust_env.randomness import Random


@dataclass(frozen=True, eq=False)
class NetworkAttacker:
    """A network that decides for all compromised agents, on NumPy.

    Attributes:
        network: Network, or model, from observations to actions.
        knowledge: Knowledge of the attacker; None is that of the task.
    """

    network: Decider
    knowledge: Knowledge | None = None

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, ...]) -> Any:
        """See `roletrust_env.evaluation.attackers.Attacker`."""
        observed = task if self.knowledge is None else with_knowledge(task, self.knowledge)
        return observed, self.network.begin(np.zeros(batch))

    def act(self, task: AttackTask, state: TaskState, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `roletrust_env.evaluation.attackers.Attacker`."""
        observed, remembered = memory
        action, remembered = self.network(observed.observe(state), remembered)
        return cast(action, task.game.like.dtype), (observed, remembered)


def with_knowledge(task: AttackTask, knowledge: Knowledge) -> AttackTask:
    """Return the same task, observed with another knowledge."""
    other = copy.copy(task)
    other.knowledge = knowledge
    return other
