"""The attack task of a coalition as one mind: features of each provider, and a decision about each provider."""

from typing import Any

from roletrust_env.arrays import Array
from roletrust_env.game.attack_task import AttackTask, TaskState
from roletrust_env.game.coalition import FEATURES, Coalition, CoalitionMemory
from roletrust_env.game.state import Actions, State
from roletrust_env.randomness import Random


class CoalitionTask(AttackTask):
    """An attack task in which the compromised agents share what they see and tell the same lie.

    Rewards and rules are those of `AttackTask`. The observation holds the features of each provider, and the action a
    decision about each provider, so that a network with shared weights plays with any number of them. This is what the
    coalitions of `roletrust_agents` learn with.

    Args:
        *arguments: Arguments of `AttackTask`.
        **options: Further arguments of `AttackTask`.

    Raises:
        ValueError: The knowledge is not `"black_box"`, or see `AttackTask`.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        if self.knowledge != "black_box":
            raise ValueError(f"knowledge is {self.knowledge!r}; a coalition has black_box knowledge")
        self.coalition = Coalition(self.game, self.identities)

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and greatest value of an entry of an observation."""
        return -1.0, 1.0

    @property
    def action_size(self) -> int:
        """Size A of an action: P lies if the coalition rates, then P qualities if it provides, see `Coalition`."""
        return self.coalition.action_size

    def follow(self, game: State, memories: tuple[Any, ...], before: TaskState | None) -> TaskState:
        """Return the state of the task with the memory of the coalition. See `AttackTask.follow`."""
        known = self.coalition.begin(game) if before is None else _known(before)
        return TaskState(game, memories, self.coalition.remember(game, known))

    def joint(self, state: TaskState, action: Array | Actions, random: Random) -> tuple[Actions, tuple[Any, ...]]:
        """Return the actions of all agents and the memories of the scripted ones. See `AttackTask.joint`."""
        if not isinstance(action, Actions):
            action = self.coalition.actions(action, _known(state))
        return super().joint(state, action, random)

    def observe(self, state: TaskState) -> Array:
        """Return the features of the providers, shape (F P, ...): each feature for all providers, in their order."""
        features = self.coalition.features(state.game, _known(state))
        return features.reshape(len(FEATURES) * features.shape[1], *features.shape[2:])


def _known(state: TaskState) -> CoalitionMemory:
    """Return the memory of the coalition."""
    if state.coalition is None:
        raise ValueError("the state is of another task; begin with start() of this one")
    return state.coalition
