"""Trained attackers in games: as policies like the scripted ones, or as the attacker of their own
task.
"""

from typing import Any, ClassVar

import numpy as np

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker, attacker_for
from roletrust_agents.learned.coalition_member import CoalitionMember, CoalitionSize, member_of
from roletrust_agents.learned.deep_set import DeepSet
from roletrust_agents.learned.network import Decider, Network
from roletrust_agents.learned.saved import SavedAttacker, load_attacker
from roletrust_env.arrays import Array, namespace
from roletrust_env.evaluation.attackers import AttackedPlayers, Attacker, Scripted
from roletrust_env.evaluation.measurement import weighted_outcomes
from roletrust_env.frozen import Frozen
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.game.rollout import rollout
from roletrust_env.game.views import AgentView, ProviderView, RaterView, ViewLayout
from roletrust_env.randomness import Random
from roletrust_env.world.group import Role
from roletrust_env.world.roster import Roster, role_in_name


class LearnedPolicy(Frozen, Policy):
    """Policy of a trained attacker that controls one agent.

    `learned_policy` returns the policy of a saved attacker, and `policy_of` that of a model of
    Stable-Baselines3.

    The observations are those of the training, so the games must have the same number of raters and
    providers. In a longer game, the observed time stops at the end of the game length known from
    training.

    Args:
        decide: Network or model that was trained for one agent, with the knowledge `"black_box"`.
        layout: Layout of the observations in training.
        description: Description of this attacker, for its `repr`.
    """

    def __init__(self, decide: Decider, layout: ViewLayout, description: str) -> None:
        self._decider, self._layout, self._description = decide, layout, description

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._description})"

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return the memory of the LSTM, if there is one. See `Policy.begin`."""
        return self._decider.begin(random.uniform(shape)) if self._decider.has_memory else None

    def _decide(self, observation: Array, memory: Any) -> tuple[Array, Any]:
        """Return the action, shape (A, ...), for an observation, shape (K, ...), clipped to the
        range of training.
        """
        try:
            return self._decider(namespace(observation).clip(observation, 0.0, 1.0), memory)
        except ValueError as error:
            size = f"{self._layout.n_raters} raters and {self._layout.n_providers} providers"
            raise ValueError(
                f"{self!r} was trained with {size}, and can play only with as many: {error}"
            ) from None


class LearnedProvider(LearnedPolicy):
    """Trained provider."""

    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the quality that the network chooses. See `Policy.quality`."""
        action, memory = self._decide(self._layout.flatten(view), memory)
        return action[0], memory


class LearnedRater(LearnedPolicy):
    """Trained rater."""

    attacks: ClassVar[frozenset[Channel]] = frozenset({"ratings"})

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the ratings that the network chooses. See `Policy.ratings`."""
        return self._decide(self._layout.flatten(view), memory)


class LearnedBoth(LearnedPolicy):
    """Trained agent with both roles, which observes both and decides on both at once."""

    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Raise an error, because the view of one role is not the whole observation. See `both`."""
        raise TypeError(f"{self!r} decides on quality and ratings at once; call `both`")

    def both(self, view: AgentView, memory: Any, random: Random) -> tuple[Array, Array, Any]:
        """Return the quality, shape (...), the ratings, shape (P, ...), and the new memory."""
        action, memory = self._decide(self._layout.flatten_both(view), memory)
        return action[0], action[1:], memory


def learned_policy(attacker: SavedAttacker) -> LearnedPolicy:
    """Return the policy of a saved attacker.

    Raises:
        ValueError: The attacker controls several agents, or observes more than a view of its agent.
            Such attackers play in their own task, see `play_task`.
    """
    card, task = attacker.card, attacker.card.task
    if isinstance(attacker.network, DeepSet):
        raise ValueError(
            "the attacker is a coalition, which plays all compromised agents of a task as one "
            "mind; play it as a "
            "search method, see `CoalitionAttacker`. Members that each decide "
            "alone are `learned_member`"
        )
    if len(task.compromised) > 1 or task.knowledge != "black_box":
        raise ValueError(
            f"the attacker controls {', '.join(task.compromised)} with {task.knowledge} knowledge; "
            "a policy controls "
            "one agent with black_box knowledge. The attacker can play in its own task: see "
            "`play_task`"
        )
    description = f"{card.training.algorithm}, {card.task.id}, {card.weights_sha256[:8]}"
    return policy_for(
        role_in_name(task.compromised[0]), attacker.network, attacker.layout, description
    )


def policy_for(role: Role, decide: Decider, layout: ViewLayout, description: str) -> LearnedPolicy:
    """Return the policy for an agent of a role. The other arguments are those of
    `LearnedPolicy`.
    """
    classes: dict[Role, type[LearnedPolicy]] = {
        "SP": LearnedProvider,
        "SR": LearnedRater,
        "SR+SP": LearnedBoth,
    }
    return classes[role](decide, layout, description)


def learned_member(attacker: SavedAttacker, accomplices: tuple[int, ...]) -> CoalitionMember:
    """Return the policy of each member of a saved coalition.

    Args:
        attacker: Saved coalition; its network is a deep set.
        accomplices: Indices of the coalition's providers on the provider axis.

    Raises:
        ValueError: The attacker is no coalition, or see `member_of`.
    """
    card, roster = attacker.card, Roster.of(attacker.card.scenario)
    if not isinstance(attacker.network, DeepSet):
        raise ValueError("accomplices are those of a coalition; the attacker is none")
    compromised = set(card.task.compromised)
    raters = sum(name in compromised for name in roster.rater_names)
    size = CoalitionSize(roster.n_providers, raters / roster.n_raters, card.scenario.max_cycles)
    return member_of(
        attacker.network,
        size,
        accomplices,
        provides=bool(compromised & set(roster.provider_names)),
        description=f"{card.training.algorithm}, {card.weights_sha256[:8]}",
    )


def coalition_of(path: str) -> CoalitionAttacker:
    """Return the attacker of a saved coalition, which plays any number of agents as one mind.

    Args:
        path: See `load_attacker`.

    Raises:
        ValueError: The files are not valid, or the attacker is not a coalition.
    """
    attacker = load_attacker(path)
    if not isinstance(attacker.network, DeepSet):
        size = f"{attacker.layout.n_raters} raters and {attacker.layout.n_providers} providers"
        raise ValueError(
            f"saved attacker {path} was trained with {size}, and plays no other number of agents; "
            "it must be a coalition, such as `roletrust train standard:coalition` trains"
        )
    return CoalitionAttacker(attacker.network)


def learned(path: str, accomplices: tuple[int, ...] = ()) -> Policy:
    """Trained attacker, loaded from a pair of files, NAME.json and NAME.safetensors.

    Args:
        path: Path of the files, or name of an attacker that comes with the project; see
            `load_attacker`.
        accomplices: Indices of the coalition's providers, for a coalition such as
            `universal-coalition`, of which each seated agent is a member that decides for itself,
            see `CoalitionMember`.

    Raises:
        ValueError: The files are not valid, the attacker is no coalition and does not control one
            agent with black-box knowledge, or the accomplices do not fit, see `member_of`.
    """
    attacker = load_attacker(path)
    if accomplices or isinstance(attacker.network, DeepSet):
        return learned_member(attacker, accomplices)
    return learned_policy(attacker)


def play_task(
    task: AttackTask, network: Network | DeepSet | None, *, games: int, seed: int
) -> Array:
    """Return the score of each game, shape (E,): the mean reward per round, 0 after the attacker
    has been caught.

    Args:
        task: Task to play, on NumPy.
        network: Network that decides for the compromised agents; None plays honestly.
        games: Number of games, E.
        seed: Random seed.

    Raises:
        ValueError: The observations or the actions of the network have another size than those of
            the task.
    """
    if isinstance(network, Network) and network.architecture.outputs != task.action_size:
        raise ValueError(
            f"the network has {network.architecture.outputs} actions, the task {task.action_size}"
        )
    attacker = Scripted({}) if network is None else attacker_for(network)
    return play_attacker(task, attacker, games=games, seed=seed)


def play_attacker(
    task: AttackTask, attacker: Attacker, *, games: int, seed: int, rows: int | None = None
) -> Array:
    """Return the score of each game of any attacker, see `play_task`; shape (K, E) for K = `rows`
    attackers side by side.
    """
    random = task.game.random(seed)
    score = np.zeros((games,) if rows is None else (rows, games))
    players = AttackedPlayers(task, attacker)
    played = rollout(players, random, random, (games,), rows=rows)
    for _, outcome in weighted_outcomes(task, played):
        score += outcome.reward
    return score / task.game.scenario.mean_length
