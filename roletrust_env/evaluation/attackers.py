"""Attackers: all compromised agents of a task as one mind, by a policy for each agent or by a fixed
sequence.

A record holds an attacker as JSON, which loads without a search and without code: a kind and the
fields of that kind. Packages add kinds by entry points of the group
`roletrust_env.recorded_attackers`: a factory takes the fields and returns the attacker.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cached_property
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.attack_task import AttackTask, TaskState
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy, checked_actions
from roletrust_env.game.policy import ByChannel, Channel, Policy, policy_name
from roletrust_env.game.policy import registry as attackers
from roletrust_env.game.state import Actions, State
from roletrust_env.game.views import IdentityView, ProviderView, RaterView
from roletrust_env.randomness import Random
from roletrust_env.registry import Registry
from roletrust_env.storage.untrusted import parse_json

HONEST_POLICY = Policy()


@dataclass(frozen=True)
class Both(ByChannel):
    """A policy for an SR+SP agent: it serves by one policy and rates by another.

    Attributes:
        serves: Policy for services.
        rates: Policy for ratings.
    """

    serves: Policy
    rates: Policy
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    @property
    def reserve(self) -> int:  # type: ignore[override]
        """Number of identities in reserve that the policy needs: that of the part that needs
        more.
        """
        return max(self.serves.reserve, self.rates.reserve)

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Let the part that uses identities decide, or the serving part if both do. See
        `Policy.presence`.
        """
        serves, rates = memory
        if self.serves.reserve:
            present, serves = self.serves.presence(view, serves, random)
        else:
            present, rates = self.rates.presence(view, rates, random)
        return present, (serves, rates)


@dataclass(frozen=True)
class SideBySide(Policy):
    """K policies side by side in a batch of games of shape (K, G): the k-th plays in the k-th row.

    One batch then tries many parameters of an attack at once.

    Attributes:
        policies: Policies of the rows.
    """

    policies: tuple[Policy, ...]

    @property
    def attacks(self) -> frozenset[Channel]:  # type: ignore[override]
        """Channels on which any of the policies attacks."""
        return frozenset[Channel]().union(*(policy.attacks for policy in self.policies))

    @property
    def reserve(self) -> int:  # type: ignore[override]
        """Number of identities in reserve that the policies need: the largest of them."""
        return max(policy.reserve for policy in self.policies)

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return the memories of the policies. See `Policy.begin`."""
        return tuple(policy.begin(random, (*shape[:-2], shape[-1])) for policy in self.policies)

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.quality`."""
        return _stack(self._rows("quality", view, memory, random))

    def treats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """See `Policy.treats`."""
        return self._unusual(
            "treats", view, memory, random, lambda: 0 * view.ratings[..., 0, :] + 1
        )

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.ratings`."""
        return _stack(self._rows("ratings", view, memory, random))

    def withholds(self, view: RaterView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """See `Policy.withholds`."""
        return self._unusual(
            "withholds", view, memory, random, lambda: view.awaiting[..., 0, :] & False
        )

    def claims(self, view: RaterView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """See `Policy.claims`."""
        return self._unusual("claims", view, memory, random, lambda: 0 * view.published[..., 0, :])

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.presence`."""
        return _stack(self._rows("presence", view, memory, random))

    def _unusual(
        self, channel: str, view: Any, memory: Any, random: Random, usual: Callable[[], Array]
    ) -> tuple[Array | None, Any]:
        """Stack actions on a channel that few policies use. None stands for the usual action; all
        None stay None.
        """
        if all(
            getattr(type(policy), channel) is getattr(Policy, channel) for policy in self.policies
        ):
            return None, memory
        rows = self._rows(channel, view, memory, random)
        if all(done is None for done, _ in rows):
            return None, tuple(after for _, after in rows)
        return _stack([(usual() if done is None else done, after) for done, after in rows])

    def _rows(self, channel: str, view: Any, memory: Any, random: Random) -> list[tuple[Any, Any]]:
        """Return what each policy does on a channel in its row of games, shape (K, G), and its
        memory.
        """
        rows = (
            type(view)(*(field[..., k, :] for field in view)) for k in range(len(self.policies))
        )
        return [
            getattr(policy, channel)(row, memory[k], random)
            for k, (policy, row) in enumerate(zip(self.policies, rows, strict=True))
        ]


def side_by_side(attacks: Sequence[Mapping[str, Policy]]) -> dict[str, Policy]:
    """Return K attacks as one attack, for a batch of games of shape (K, G)."""
    return {name: SideBySide(tuple(attack[name] for attack in attacks)) for name in attacks[0]}


def _stack(rows: Sequence[tuple[Array, Any]]) -> tuple[Array, Any]:
    """Stack the actions of K policies, (..., G) each, to (..., K, G), and return their memories."""
    done = [row[0] for row in rows]
    stacked = (
        np.stack(done, axis=-2)
        if isinstance(done[0], np.ndarray)
        else namespace(done[0]).stack(done, axis=-2)
    )
    return stacked, tuple(row[1] for row in rows)


@runtime_checkable
class Attacker(Protocol):
    """All compromised agents of a task as one mind, in a batch of games."""

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, ...]) -> Any:
        """Return the memory before the first round."""

    def act(
        self, task: AttackTask, state: TaskState, memory: Any, random: Random
    ) -> tuple[Array | Actions, Any]:
        """Return the action and the new memory.

        The action has shape (A, *batch), see `AttackTask.action_size`, or is an `Actions` of all
        agents, of which those of the attacker's identities count.
        """


@runtime_checkable
class Stackable(Attacker, Protocol):
    """An attacker that can play side by side with others of its kind, as in games of its own."""

    def stacks_with(self, other: Attacker) -> bool:
        """Return whether both can play side by side."""

    def stack(self, task: AttackTask, others: Sequence[Any]) -> Attacker:
        """Return K attackers side by side in a task, for a batch of games of shape (K, G): this
        one, and others, of which there may be none.
        """


@dataclass(frozen=True, eq=False)
class Scripted:
    """An attacker with a policy for each compromised agent; an agent without a policy plays
    honestly.

    The policies use every channel, also those that the action of a task lacks: presence, silence,
    claims and treatment.
    """

    policies: Mapping[str, Policy]

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, ...]) -> Any:
        """See `Attacker.begin`."""
        joint_policy = JointPolicy(task.game, self.policies)
        return joint_policy, joint_policy.begin(random, batch)

    def act(
        self, task: AttackTask, state: TaskState, memory: Any, random: Random
    ) -> tuple[Actions, Any]:
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

    def act(
        self, task: AttackTask, state: TaskState, memory: Any, random: Random
    ) -> tuple[Array, Any]:
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
        """Return the memories of the scripted agents and of the attacker, and no state of the task
        yet.
        """
        scripted = self.task.joint_policy.begin(random, batch)
        return scripted, self.attacker.begin(self.task, random, batch), None

    def checked_act(self, state: State, memory: Any, random: Random) -> tuple[Actions, Any]:
        """See `roletrust_env.game.rollout.Players`."""
        if self._plays_all:
            return self._act(state, memory, random)  # scripts are checked on their own
        return checked_actions(self.game, state, "the attacker", self._act, memory, random)

    def _act(self, state: State, memory: Any, random: Random) -> tuple[Actions, Any]:
        scripted, own, before = memory
        task_state = self.task.follow(state, scripted, before)
        action, own = self.attacker.act(self.task, task_state, own, random)
        if self._plays_all:
            return action, (scripted, own, task_state)
        actions, scripted = self.task.joint(task_state, action, random)
        return actions, (scripted, own, task_state)

    @cached_property
    def _plays_all(self) -> bool:
        """True if the attacker's actions are those of all agents: scripts of its own, where nobody
        else has one.
        """
        if not isinstance(self.attacker, Scripted) or self.task.joint_policy.policies:
            return False
        return set(self.attacker.policies) <= set(self.task.compromised)


MAX_RECORD = 200_000
"""Maximum length of a record in characters."""

_DEPTH = 4

recorded_attackers: Registry[Attacker] = Registry(
    "kind of recorded attacker", "roletrust_env.recorded_attackers", Attacker
)


@runtime_checkable
class Recordable(Protocol):
    """An attacker that can be recorded."""

    def record(self) -> dict[str, Any]:
        """Return the kind of the attacker and the fields of this kind, as plain data for JSON."""


def record_of(attacker: Attacker) -> str:
    """Return the record of an attacker, or an empty text if it cannot be recorded.

    A policy of a module that is not installed as a plug-in has no name, and so no record.
    """
    if isinstance(attacker, Recordable):
        data = attacker.record()
    elif isinstance(attacker, Scripted):
        data = {
            "kind": "scripts",
            "policies": {name: _plain(policy) for name, policy in attacker.policies.items()},
        }
    else:
        return ""
    try:
        text = json.dumps(data, separators=(",", ":"))
        again = read_record(text)
    except (TypeError, ValueError):  # a parameter is no plain data, or a policy has no name
        return ""
    lost = (
        isinstance(again, Scripted)
        and isinstance(attacker, Scripted)
        and again.policies != attacker.policies
    )
    return "" if lost else text


def read_record(text: str) -> Attacker:
    """Return the attacker of a record.

    Raises:
        ValueError: The record is too long, is not valid, or names what is not installed.
    """
    if len(text) > MAX_RECORD:
        raise ValueError(
            f"the record of an attacker has {len(text)} characters; the limit is {MAX_RECORD}"
        )
    try:
        data = parse_json(text.encode())
    except ValueError as error:
        raise ValueError(f"the record of an attacker: {error}") from None
    if not isinstance(data, dict) or not isinstance(data.get("kind"), str):
        raise ValueError(
            f"the record of an attacker must be an object with a kind, not {text[:100]!r}"
        )
    kind = data.pop("kind")
    try:
        return recorded_attackers.make(kind, **data)
    except TypeError as error:  # a value of the wrong type, or a field that no kind has
        raise ValueError(f"the record of an attacker of the kind {kind!r}: {error}") from None


def scripted(policies: Mapping[str, Any]) -> Scripted:
    """Scripted attackers, each with its parameters.

    Args:
        policies: Plain data of the policy of each agent: its name and its parameters, or those of
            the policies by which it serves and rates.

    Raises:
        ValueError: A policy is not valid, or not installed.
    """
    if not isinstance(policies, Mapping):
        raise ValueError(f"policies must be an object, not {str(policies)[:100]!r}")
    return Scripted({name: _policy(data) for name, data in policies.items()})


recorded_attackers.register("scripts", scripted)


def _plain(value: Any) -> Any:
    """Return a policy as plain data, and any other parameter as it is."""
    if not isinstance(value, Policy):
        return value
    if isinstance(value, Both):
        return {"serves": _plain(value.serves), "rates": _plain(value.rates)}
    if type(value) is Policy:
        return {}
    parameters: list[str] = (
        [field.name for field in fields(value) if field.init] if is_dataclass(value) else []
    )
    return {
        "name": policy_name(value),
        **{name: _plain(getattr(value, name)) for name in parameters},
    }


def _policy(data: Any, depth: int = 0) -> Policy:
    """Return the policy of plain data. Without a name it is honest."""
    if depth > _DEPTH:
        raise ValueError(f"policies must not be nested more than {_DEPTH} deep")
    if not isinstance(data, dict):
        raise ValueError(f"a policy must be an object, not {str(data)[:100]!r}")
    if data.keys() == {"serves", "rates"}:
        return Both(_policy(data["serves"], depth + 1), _policy(data["rates"], depth + 1))
    if not data:
        return HONEST_POLICY
    if not isinstance(data.get("name"), str):
        raise ValueError(f"a policy must have a name: {str(data)[:100]!r}")
    if not isinstance(attackers.factory(data["name"]), type):
        raise ValueError(
            f"a record may not name {data['name']!r}, which a function makes and which may read "
            "files"
        )
    parameters = {key: _parameter(value, depth + 1) for key, value in data.items() if key != "name"}
    return attackers.make(data["name"], **parameters)


def _parameter(value: Any, depth: int) -> Any:
    """Return a parameter of a policy, which may itself be a policy."""
    if isinstance(value, list):
        return tuple(value)
    return _policy(value, depth) if isinstance(value, dict) else value
