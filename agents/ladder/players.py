"""How all agents of one attacker play together: each by a policy of its own, or by a sequence fixed beforehand."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from roletrust_env.arrays import Array
from roletrust_env.game.attack import AttackTask, TaskState
from roletrust_env.game.cast import Cast
from roletrust_env.game.policy import Policy, policy_name
from roletrust_env.randomness import Random


class Attacker(Protocol):
    """How all compromised agents play, as one mind, in a batch of games of shape (K, G)."""

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, int]) -> Any:
        """What it remembers before the first round."""
        ...

    def act(self, task: AttackTask, state: TaskState, memory: Any, random: Random) -> tuple[Array, Any]:
        """The joint action, (A, K, G), see `AttackTask.action_size`, and the new memory."""
        ...


@dataclass(frozen=True, eq=False)
class Scripted:
    """Each compromised agent has a policy of its own, and plays honestly without.

    A policy that needs more than a task's action has is refused, see `check_fits_tasks`.
    """

    policies: Mapping[str, Policy]

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, int]) -> Any:
        """See `Attacker.begin`."""
        for name, policy in self.policies.items():
            check_fits_tasks(policy, name)
        cast = Cast(task.game, self.policies)
        return cast, cast.begin(random, batch)

    def act(self, task: AttackTask, state: TaskState, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Attacker.act`."""
        cast, memories = memory
        actions, memories = cast.checked_act(state.game, memories, random)
        return task.own_action(actions), (cast, memories)


def check_fits_tasks(policy: Policy, who: str) -> None:
    """Look whether a compromised agent can play a policy: a task's action has no presence and no silence.

    Raises:
        ValueError: it takes identities in reserve, or attacks on other channels than an action has.
    """
    if policy.reserve or (policy.attacks and policy.attacks.isdisjoint(("quality", "ratings"))):
        what = "calls identities in reserve" if policy.reserve else f"attacks by {' and '.join(sorted(policy.attacks))}"
        raise ValueError(
            f"{who} cannot play {policy_name(policy)} in a task: that {what}, and a task's action has quality and "
            "ratings only; it plays in a Cast, and as one of the task's others"
        )


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
