"""How all agents of one attacker play together: each by a policy of its own, or by a sequence fixed beforehand."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from roletrust_env.arrays import Array
from roletrust_env.game.attack_task import AttackTask, TaskState
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.policy import Policy
from roletrust_env.game.state import Actions
from roletrust_env.randomness import Random


class Attacker(Protocol):
    """How all compromised agents play, as one mind, in a batch of games of shape (K, G)."""

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, int]) -> Any:
        """What it remembers before the first round."""
        ...

    def act(self, task: AttackTask, state: TaskState, memory: Any, random: Random) -> tuple[Array | Actions, Any]:
        """The joint action, (A, K, G), see `AttackTask.action_size`, or all agents' actions; and the new memory."""
        ...


@dataclass(frozen=True, eq=False)
class Scripted:
    """Each compromised agent has a policy of its own, and plays honestly without.

    Policies play on every channel, also on those that a task's action does not have: presence, silence and treatment.
    """

    policies: Mapping[str, Policy]

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, int]) -> Any:
        """See `Attacker.begin`."""
        joint_policy = JointPolicy(task.game, self.policies)
        return joint_policy, joint_policy.begin(random, batch)

    def act(self, task: AttackTask, state: TaskState, memory: Any, random: Random) -> tuple[Actions, Any]:
        """See `Attacker.act`."""
        joint_policy, memories = memory
        actions, memories = joint_policy.checked_act(state.game, memories, random)
        return actions, (joint_policy, memories)


@dataclass(frozen=True, eq=False)
class OpenLoop:
    """A fixed sequence of joint actions, whatever happens: (T, A), or (T, A, K) for K sequences side by side."""

    actions: Array

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, int]) -> Any:
        """See `Attacker.begin`."""
        return 0

    def act(self, task: AttackTask, state: TaskState, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Attacker.act`."""
        action = self.actions[memory]
        whole = 0 * state.game.quality[:1]  # (1, K, G)
        return action.reshape(action.shape[0], -1, 1) + whole, memory + 1
