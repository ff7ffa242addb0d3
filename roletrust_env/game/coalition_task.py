"""The attack task of a coalition as one mind: features of each provider, and a decision about each
provider.
"""

from typing import Any

from roletrust_env.arrays import cast, namespace
from roletrust_env.game.attack_task import AttackTask, Outcome, TaskState
from roletrust_env.game.coalition import Coalition, CoalitionMemory
from roletrust_env.game.state import Action, Actions, Noise, State
from roletrust_env.game.views import ObservationVector
from roletrust_env.randomness import Random


class CoalitionTask(AttackTask):
    """An attack task in which the compromised agents share what they see and tell the same lie.

    Rewards and rules are those of `AttackTask`. The observation holds the features of each
    provider, and the action a decision about each provider, so that a network with shared weights
    plays with any number of them. This is what the coalitions of `roletrust_agents` learn with. A
    wide one also observes the accounts of raters with own providers, and decides on silence, on
    the treatment of each rater and, where reports are open, on claims.

    Args:
        *arguments: Arguments of `AttackTask`.
        wide: Whether the coalition is wide, see `Coalition`.
        **options: Further arguments of `AttackTask`.

    Raises:
        ValueError: The knowledge is not `"black_box"`, or see `AttackTask`.
    """

    def __init__(self, *arguments: Any, wide: bool = False, **options: Any) -> None:
        super().__init__(*arguments, **options)
        if self.knowledge != "black_box":
            raise ValueError(
                f"knowledge is {self.knowledge!r}; a coalition has black_box knowledge"
            )
        self.coalition = Coalition(self.game, self.identities, wide=wide)

    @property
    def options(self) -> dict[str, Any]:
        """Arguments of the constructor beside the game and the compromised agents."""
        return {**super().options, "wide": self.coalition.silent or self.coalition.treats}

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and greatest value of an entry of an observation."""
        return -1.0, 1.0

    @property
    def action_size(self) -> int:
        """Size A of an action, see `Coalition.decision`."""
        return self.coalition.action_size

    def follow(self, game: State, memories: tuple[Any, ...], before: TaskState | None) -> TaskState:
        """Return the state of the task with the memory of the coalition. See
        `AttackTask.follow`.
        """
        known = self.coalition.begin(game) if before is None else _known(before)
        return TaskState(game, memories, self.coalition.remember(game, known))

    def joint(
        self, state: TaskState, action: Action | Actions, random: Random
    ) -> tuple[Actions, tuple[Any, ...]]:
        """Return the actions of all agents and the memories of the scripted ones. See
        `AttackTask.joint`.
        """
        if not isinstance(action, Actions):
            decision = self.coalition.decision(cast(action, self.game.like.dtype))
            action = self.coalition.actions(decision, _known(state))
        return super().joint(state, action, random)

    def advance(
        self, state: TaskState, actions: Actions, memories: tuple[Any, ...], noise: Noise
    ) -> tuple[TaskState, Outcome]:
        """Play one round, and remember the services that were given. See `AttackTask.advance`."""
        return super().advance(
            state._replace(coalition=self.coalition.gave(_known(state), actions)),
            actions,
            memories,
            noise,
        )

    def observe(self, state: TaskState) -> ObservationVector:
        """Return the observation, shape (F P, ...), or (F P + A S n, ...) of a wide coalition with
        n providers.

        Each of F features for all providers, in their order; then each of A features for all
        accounts, rater by rater.
        """
        batch = state.game.round.shape
        features = self.coalition.features(state.game, _known(state)).reshape(-1, *batch)
        if not self.coalition.treats:
            return features
        accounts = self.coalition.account_features(_known(state)).reshape(-1, *batch)
        return namespace(features).concat([features, accounts])


def _known(state: TaskState) -> CoalitionMemory:
    """Return the memory of the coalition."""
    if state.coalition is None:
        raise ValueError("the state is of another task; begin with start() of this one")
    return state.coalition
