"""What is written behind `--attack`, `--trust-model` and `--set`, as policies, models and values."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

from baselines import make_attacker
from roletrust_env import Policy, Scenario, make_trust_model
from roletrust_env.trust import TrustModel
from roletrust_env.world.roster import Roster

# A comma that no bracket, brace or quote encloses; values are not nested deeper than TOML's inline tables need.
_COMMA = re.compile(r""",(?=(?:[^\[\]{}"']|\[[^\]]*\]|\{[^}]*\}|"[^"]*"|'[^']*')*$)""")


def parse_value(text: str) -> Any:
    """A value as TOML has it (`3`, `0.5`, `true`, `[0, 1]`, `{kind = "choice"}`), or else the text itself.

    Example:
        >>> parse_value("0.5"), parse_value("[0, 1]"), parse_value("random")
        (0.5, (0, 1), 'random')
    """
    try:
        data = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return _frozen(data["value"]) if len(data) == 1 else text


def parse_settings(settings: Sequence[str], option: str = "--set") -> dict[str, Any]:
    """`field=value` texts as a dict.

    Args:
        settings: the texts.
        option: where they come from, for error messages.

    Raises:
        ValueError: a text is not of that form, or names a field again.
    """
    parsed: dict[str, Any] = {}
    for setting in settings:
        field, equals, value = setting.partition("=")
        field = field.strip()
        if not equals or not field:
            raise ValueError(f"{option} has {setting!r}; it must be of the form field=value")
        if field in parsed:
            raise ValueError(f"{option} sets {field!r} twice")
        parsed[field] = parse_value(value.strip())
    return parsed


def parse_attacks(texts: Sequence[str], scenario: Scenario) -> dict[str, Policy]:
    """`AGENT=NAME:key=value,key=value` texts as policies by agent.

    Args:
        texts: AGENT may be a pattern, such as `sr_*` or `sr_[0-2]`.
        scenario: whose agents they are.

    Raises:
        ValueError: a text is not of that form, names no agent or an agent again, or the attacker cannot be made.
    """
    policies: dict[str, Policy] = {}
    for text in texts:
        pattern, equals, attacker = text.partition("=")
        if not equals or not pattern or not attacker:
            raise ValueError(f"--attack has {text!r}; it must be of the form AGENT=NAME or AGENT=NAME:key=value,...")
        policy = _made(make_attacker, attacker, {})
        for agent in _agents(pattern.strip(), Roster.of(scenario).names):
            if agent in policies:
                raise ValueError(f"--attack gives agent {agent!r} two attacks; an agent has one policy")
            policies[agent] = policy
    return policies


def parse_trust_model(text: str, scenario: Scenario) -> TrustModel[Any]:
    """`NAME` or `NAME:key=value,...` as a trust model, with the scenario's `lam` and `initial_trust` if not given.

    Raises:
        ValueError: the name is unknown, or the model does not take these parameters.
    """
    model: TrustModel[Any] = _made(make_trust_model, text, {"lam": scenario.lam, "initial": scenario.initial_trust})
    return model


def _made(make: Any, text: str, defaults: Mapping[str, Any]) -> Any:
    name, _, rest = text.strip().partition(":")
    parameters = parse_settings([part for part in _COMMA.split(rest) if part.strip()], option=repr(text))
    try:
        return make(name, **{**defaults, **parameters})
    except TypeError as error:  # a value of the wrong type, which the maker compared or computed with
        raise ValueError(f"{text!r}: a value is of the wrong type ({error})") from None


def _agents(pattern: str, names: Sequence[str]) -> list[str]:
    """The agents that a pattern names; the game itself checks a plain name."""
    if not any(character in pattern for character in "*?["):
        return [pattern]
    found = [name for name in names if fnmatchcase(name, pattern)]
    if not found:
        raise ValueError(f"--attack names {pattern!r}, which no agent matches; they are {names[0]} ... {names[-1]}")
    return found


def _frozen(value: Any) -> Any:
    """Lists as tuples, so that a policy that holds them can be hashed."""
    if isinstance(value, list):
        return tuple(_frozen(item) for item in value)
    return {key: _frozen(item) for key, item in value.items()} if isinstance(value, dict) else value
