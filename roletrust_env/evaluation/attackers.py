"""Attackers: all compromised agents of a task as one mind, by a policy for each agent or by a fixed sequence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self, runtime_checkable

from roletrust_env.arrays import Array
from roletrust_env.game.attack_task import AttackTask, TaskState
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy, checked_actions
from roletrust_env.game.policy import Policy
from roletrust_env.game.state import Actions, State
from roletrust_env.randomness import Random


@runtime_checkable
class Attacker(Protocol):
    """All compromised agents of a task as one mind, in a batch of games."""

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, ...]) -> Any:
        """Return the memory before the first round."""
        ...

    def act(self, task: AttackTask, state: TaskState, memory: Any, random: Random) -> tuple[Array | Actions, Any]:
        """Return the action and the new memory.

        The action has shape (A, *batch), see `AttackTask.action_size`, or is an `Actions` of all agents, of which those
        of the attacker's identities count.
        """
        ...


@runtime_checkable
class Stackable(Attacker, Protocol):
    """An attacker that can play side by side with others of its kind, as in games of its own."""

    def stacks_with(self, other: Attacker) -> bool:
        """Return whether both can play side by side."""
        ...

    def stack(self, others: Sequence[Any]) -> Self:
        """Return K attackers side by side for a batch of games of shape (K, G): this one, and others."""
        ...

    def row(self, k: int) -> Self:
        """Return the k-th of K attackers side by side."""
        ...


@dataclass(frozen=True, eq=False)
class Scripted:
    """An attacker with a policy for each compromised agent; an agent without a policy plays honestly.

    The policies use every channel, also those that the action of a task lacks: presence, silence and treatment.

    Attributes:
        policies: Policies by the name of the agent.
    """

    policies: Mapping[str, Policy]

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, ...]) -> Any:
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
    """A fixed sequence of joint actions.

    Attributes:
        actions: Actions of T rounds, shape (T, A), or shape (T, A, K) for K sequences side by side.
    """

    actions: Array

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, ...]) -> Any:
        """See `Attacker.begin`."""
        return 0

    def act(self, task: AttackTask, state: TaskState, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Attacker.act`."""
        action = self.actions[memory]
        whole = 0 * state.game.quality[:1]  # (1, K, G)
        return action.reshape(action.shape[0], -1, 1) + whole, memory + 1


@dataclass(frozen=True, eq=False)
class AttackedPlayers:
    """The players of an attacked game: the attacker, and the scripted agents of its task.

    Attributes:
        task: Task of the attacker.
        attacker: Attacker that plays it.
    """

    task: AttackTask
    attacker: Attacker

    @property
    def game(self) -> Game:
        """The game of the task."""
        return self.task.game

    def begin(self, random: Random, batch: tuple[int, ...]) -> Any:
        """Return the memories of the scripted agents and of the attacker, and no state of the task yet."""
        scripted = self.task.joint_policy.begin(random, batch)
        return scripted, self.attacker.begin(self.task, random, batch), None

    def checked_act(self, state: State, memory: Any, random: Random) -> tuple[Actions, Any]:
        """See `roletrust_env.game.rollout.Players`."""
        return checked_actions(self.game, state, "the attacker", self._act, memory, random)

    def _act(self, state: State, memory: Any, random: Random) -> tuple[Actions, Any]:
        scripted, own, before = memory
        task_state = self.task.follow(state, scripted, before)
        action, own = self.attacker.act(self.task, task_state, own, random)
        actions, scripted = self.task.joint(task_state, action, random)
        return actions, (scripted, own, task_state)
