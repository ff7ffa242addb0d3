"""What there is to be played with: scenarios, trust models and attackers, and what they take, for people and scripts.

A plug-in that cannot be loaded or read is an entry that says why, and spoils nothing else.
"""

import inspect
from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, NamedTuple, get_type_hints

from roletrust_env import Policy
from roletrust_env.evaluation.attack_space import as_spec, declared_ranges, game_facts
from roletrust_env.game.policy_registry import registry as attackers
from roletrust_env.ranges import Identities, Searched, allowed
from roletrust_env.registry import Registry, summary
from roletrust_env.trust import Traits
from roletrust_env.trust.model import registry as models
from roletrust_env.world.presets import registry as scenarios

Entry = dict[str, Any]
"""One scenario, trust model or attacker as plain data; of one that cannot be loaded or read only its `error`."""


class Parameter(NamedTuple):
    """A parameter of a trust model or an attacker.

    Attributes:
        default: its value if none is given, as plain data; None also where one has to be given.
        required: whether one has to be given.
        allowed: what values are, in words; empty where nothing says so.
    """

    default: Any
    required: bool
    allowed: str


def all_scenarios() -> dict[str, Entry]:
    """Every scenario by name, with all its fields."""
    return _entries(scenarios, lambda name: scenarios.make(name).model_dump(mode="json"))


def all_models() -> dict[str, Entry]:
    """Every trust model by name: its description, its traits and its parameters."""

    def entry(name: str) -> Entry:
        factory = models.factory(name)
        traits = Traits.of(factory if isinstance(factory, type) else models.make(name))
        said = {key: getattr(traits, key) for key in ("family", "source", "cost", "differentiable", "rates_raters")}
        parameters = {key: parameter._asdict() for key, parameter in _parameters(factory).items()}
        return {"description": summary(factory), **said, "parameters": parameters}

    return _entries(models, entry)


def all_attackers() -> dict[str, Entry]:
    """Every attacker by name: its description, its channels, its parameters, and where searches look for them.

    A parameter is searched between a low and a high end, among options, or over the honest providers ("victims");
    or not at all (None). One that is told is known from the game where a command plays the attack. Channels are None
    where only the attacker that is made knows them.
    """

    def entry(name: str) -> Entry:
        factory = attackers.factory(name)
        ranges, known = declared_ranges(factory), game_facts(factory, (0,), 1)
        parameters = {
            key: {**parameter._asdict(), "searched": _plain(ranges.get(key)), "told": key in known}
            for key, parameter in _parameters(factory).items()
        }
        channels = getattr(factory, "attacks", None)
        on = sorted(channels) if isinstance(channels, frozenset) else None
        return {"description": summary(factory), "channels": on, "parameters": parameters}

    return _entries(attackers, entry)


def unfit(entry: Entry) -> list[str]:
    """What a trust model is not fit for, in a few words each."""
    lacks = [] if entry["rates_raters"] else ["no trust in raters"]
    lacks += [] if entry["differentiable"] else ["trust jumps, no gradients"]
    return lacks + ([] if entry["cost"] in ("S P", "P") else [f"cost grows as {entry['cost']}"])


def where_searched(parameter: Mapping[str, Any]) -> str:
    """Where searches look for a parameter of an attacker, in words; empty if nowhere."""
    match parameter["searched"]:
        case {"low": low, "high": high}:
            return f"{low:g} to {high:g}"
        case {"options": options}:
            return " | ".join(map(str, options))
        case "victims" | "identities" as whom:
            return str(whom)
    return "told" if parameter["told"] else ""


def _entries(registry: Registry[Any], entry: Callable[[str], Entry]) -> dict[str, Entry]:
    found = {}
    for name in registry.names():
        try:
            found[name] = entry(name)
        except Exception as error:  # whatever a foreign package raises
            found[name] = {"error": str(error) or type(error).__name__}
    return found


def _parameters(factory: Callable[..., Any]) -> Mapping[str, Parameter]:
    """The parameters of a factory, in the order of its signature."""
    try:
        hints = get_type_hints(factory, include_extras=True)
    except Exception:  # types of a foreign factory that are no more than text
        hints = {}
    found = {}
    for name, parameter in inspect.signature(factory).parameters.items():
        required = parameter.default is parameter.empty
        default = None if required else _as_data(parameter.default)
        found[name] = Parameter(default, required, allowed(hints[name]) if name in hints else "")
    return found


def _as_data(value: Any) -> Any:
    """A default as JSON knows it; a policy in the words of the command line, and all else as Python writes it."""
    if isinstance(value, Policy):
        return as_spec(value)
    if isinstance(value, list | tuple):
        return [_as_data(item) for item in value]
    plain = value is None or isinstance(value, bool | int | str) or (isinstance(value, float) and isfinite(value))
    return value if plain else repr(value)


def _plain(range: Any) -> Any:
    """Where searches look, as plain data."""
    if isinstance(range, Searched):
        return {"low": range.low, "high": range.high}
    if isinstance(range, tuple):
        return {"options": list(range)}
    if isinstance(range, Identities):
        return "identities"
    return None if range is None else "victims"
