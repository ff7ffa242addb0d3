"""Records of attackers as JSON, which load without a search and without code.

A record holds a kind and the fields of that kind. Packages add kinds by entry points of the group
`roletrust_env.recorded_attackers`: a factory takes the fields and returns the attacker.
"""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Protocol, runtime_checkable

from roletrust_env.evaluation.attack_space import HONEST
from roletrust_env.evaluation.attackers import Attacker, Scripted
from roletrust_env.evaluation.composite import Both
from roletrust_env.game.policy import Policy, policy_name
from roletrust_env.game.policy_registry import registry as attackers
from roletrust_env.registry import Registry
from roletrust_env.storage.untrusted import parse_json

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
        ...


def record_of(attacker: Attacker) -> str:
    """Return the record of an attacker, or an empty text if it cannot be recorded.

    A policy of a module that is not installed as a plug-in has no name, and so no record.

    Args:
        attacker: Attacker.
    """
    if isinstance(attacker, Recordable):
        data = attacker.record()
    elif isinstance(attacker, Scripted):
        data = {"kind": "scripts", "policies": {name: _plain(policy) for name, policy in attacker.policies.items()}}
    else:
        return ""
    try:
        text = json.dumps(data, separators=(",", ":"))
        again = read_record(text)
    except (TypeError, ValueError):  # a parameter is no plain data, or a policy has no name
        return ""
    lost = isinstance(again, Scripted) and isinstance(attacker, Scripted) and again.policies != attacker.policies
    return "" if lost else text


def read_record(text: str) -> Attacker:
    """Return the attacker of a record.

    Args:
        text: Record.

    Raises:
        ValueError: The record is too long, is not valid, or names what is not installed.
    """
    if len(text) > MAX_RECORD:
        raise ValueError(f"the record of an attacker has {len(text)} characters; the limit is {MAX_RECORD}")
    data = parse_json(text.encode())
    if not isinstance(data, dict) or not isinstance(data.get("kind"), str):
        raise ValueError(f"the record of an attacker must be an object with a kind, not {text[:100]!r}")
    kind = data.pop("kind")
    try:
        return recorded_attackers.make(kind, **data)
    except TypeError as error:  # a value of the wrong type, or a field that no kind has
        raise ValueError(f"the record of an attacker of the kind {kind!r}: {error}") from None


def scripts(policies: Mapping[str, Any]) -> Scripted:
    """Scripted attackers, each with its parameters.

    Args:
        policies: Plain data of the policy of each agent: its name and its parameters, or those of the policies by which
            it serves and rates.

    Raises:
        ValueError: A policy is not valid, or not installed.
    """
    if not isinstance(policies, Mapping):
        raise ValueError(f"policies must be an object, not {str(policies)[:100]!r}")
    return Scripted({name: _policy(data) for name, data in policies.items()})


recorded_attackers.register("scripts", scripts)


def _plain(value: Any) -> Any:
    """Return a policy as plain data, and any other parameter as it is."""
    if not isinstance(value, Policy):
        return value
    if isinstance(value, Both):
        return {"serves": _plain(value.serves), "rates": _plain(value.rates)}
    if type(value) is Policy:
        return {}
    parameters: list[str] = [field.name for field in fields(value) if field.init] if is_dataclass(value) else []
    return {"name": policy_name(value), **{name: _plain(getattr(value, name)) for name in parameters}}


def _policy(data: Any, depth: int = 0) -> Policy:
    """Return the policy of plain data. Without a name it is honest."""
    if depth > _DEPTH:
        raise ValueError(f"policies must not be nested more than {_DEPTH} deep")
    if not isinstance(data, dict):
        raise ValueError(f"a policy must be an object, not {str(data)[:100]!r}")
    if data.keys() == {"serves", "rates"}:
        return Both(_policy(data["serves"], depth + 1), _policy(data["rates"], depth + 1))
    if not data:
        return HONEST
    if not isinstance(data.get("name"), str):
        raise ValueError(f"a policy must have a name: {str(data)[:100]!r}")
    if not isinstance(attackers.factory(data["name"]), type):
        raise ValueError(f"a record may not name {data['name']!r}, which a function makes and which may read files")
    parameters = {key: _parameter(value, depth + 1) for key, value in data.items() if key != "name"}
    return attackers.make(data["name"], **parameters)


def _parameter(value: Any, depth: int) -> Any:
    """Return a parameter of a policy, which may itself be a policy."""
    if isinstance(value, list):
        return tuple(value)
    return _policy(value, depth) if isinstance(value, dict) else value
