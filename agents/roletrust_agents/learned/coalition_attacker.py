"""Attackers that a network plays: agent by agent, or a coalition as one mind."""

from base64 import b64decode, b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture
from roletrust_agents.learned.network import Decider
from roletrust_agents.learned.weights import read_weights, weights_bytes
from roletrust_env.arrays import Array, cast
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.game.attack_task import AttackTask, Knowledge, TaskState
from roletrust_env.game.coalition import Coalition, Decision
from roletrust_env.game.state import Actions
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
        observed = task if self.knowledge is None else task.changed(knowledge=self.knowledge)
        return observed, self.network.begin(np.zeros(batch))

    def act(
        self, task: AttackTask, state: TaskState, memory: Any, random: Random
    ) -> tuple[Array, Any]:
        """See `roletrust_env.evaluation.attackers.Attacker`."""
        observed, remembered = memory
        action, remembered = self.network(observed.observe(state), remembered)
        return cast(action, task.game.like.dtype), (observed, remembered)


@dataclass(frozen=True, eq=False)
class CoalitionAttacker:
    """A coalition that plays any task by a network that treats providers alike.

    It sees what its agents see, plays every task with any number of agents, and calls identities in
    reserve.

    Attributes:
        network: Network, or K networks for a batch of games of shape (K, G).
    """

    network: DeepSet

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, ...]) -> Any:
        """See `roletrust_env.evaluation.attackers.Attacker`."""
        return Coalition(task.game, task.identities, wide=self.network.architecture.wide), None

    def act(
        self, task: AttackTask, state: TaskState, memory: Any, random: Random
    ) -> tuple[Actions, Any]:
        """See `roletrust_env.evaluation.attackers.Attacker`."""
        coalition, remembered = memory
        game = state.game
        remembered = coalition.remember(
            game, coalition.begin(game) if remembered is None else remembered
        )
        accounts = coalition.account_features(remembered) if coalition.treats else None
        decision = decide(coalition, self.network, coalition.features(game, remembered), accounts)
        actions = coalition.actions(decision, remembered)
        if coalition.has_reserve:
            presence = self.network.presence(coalition.identity_features(game))
            actions = actions._replace(presence=coalition.wanted(presence))
        return actions, (coalition, coalition.gave(remembered, actions))

    def stacks_with(self, other: Attacker) -> bool:
        """See `roletrust_env.evaluation.attackers.Stackable`."""
        return type(other) is type(self) and other.network.architecture == self.network.architecture

    def stack(self, task: AttackTask, others: Sequence[Self]) -> Self:
        """See `roletrust_env.evaluation.attackers.Stackable`."""
        if not others:
            return self
        weights = np.stack([attacker.network.flatten() for attacker in (self, *others)])
        return type(self)(DeepSet.unflatten(self.network.architecture, weights))

    def record(self) -> dict[str, Any]:
        """Return the kind and the weights. See `roletrust_env.evaluation.attackers.Recordable`."""
        weights = b64encode(weights_bytes(self.network)).decode()
        return {"kind": "coalition", "units": self.network.architecture.units, "weights": weights}


def recorded_coalition(units: int, weights: str) -> CoalitionAttacker:
    """Coalition with the weights of its network.

    Args:
        units: Number of units of each layer.
        weights: Content of a safetensors file in base64.

    Raises:
        ValueError: The weights are not those of such a network.
    """
    try:
        data = b64decode(weights, validate=True)
    except (TypeError, ValueError):
        raise ValueError("the weights of a recorded coalition must be a text in base64") from None
    arrays = read_weights(data)
    if any(weights.dtype not in (np.float32, np.float64) for weights in arrays.values()):
        raise ValueError(
            "the weights of a recorded coalition must be numbers of single or double precision"
        )
    network = DeepSet(DeepSetArchitecture.of(units, wide="treatment1.bias" in arrays), arrays)
    if network.weights["layer2.bias"].ndim != 1:
        raise ValueError("the weights of a recorded coalition must be those of one network")
    return CoalitionAttacker(network)


def decide(
    coalition: Coalition, network: DeepSet, features: Array, accounts: Array | None = None
) -> Decision:
    """Return the decision of a coalition by its network.

    Where reports are open, its raters first claim what the network lies about most.

    Args:
        coalition: Coalition; it is wide if the network is.
        network: Network.
        features: Features of the providers, see `Coalition.features`.
        accounts: Features of the accounts, see `Coalition.account_features`; None where nobody is
            treated by them.
    """
    lie, quality, *silence = network.decide(features)
    return Decision(
        lie if coalition.rates else None,
        quality if coalition.providers else None,
        silence[0] if coalition.silent else None,
        None
        if accounts is None
        else network.treatment(accounts, features[:, coalition.providers, ...]),
        abs(2 * lie - 1) if coalition.claims else None,
    )


def attacker_for(network: Decider | DeepSet, knowledge: Knowledge | None = None) -> Attacker:
    """Return the attacker that a network plays.

    Args:
        network: Network of any kind.
        knowledge: Knowledge of an attacker with a `Network`; None is that of the task. A coalition
            needs none.
    """
    return (
        CoalitionAttacker(network)
        if isinstance(network, DeepSet)
        else NetworkAttacker(network, knowledge)
    )
