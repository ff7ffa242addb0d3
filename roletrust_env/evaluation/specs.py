"""Specs: the texts behind `--attack`, `--model` and `--set`, as policies, models and values."""

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatchcase
from functools import partial
from typing import Any

from roletrust_env.errors import suggest
from roletrust_env.evaluation.scripts import AttackKind, declared_facts
from roletrust_env.game.policy import Policy
from roletrust_env.game.policy import registry as attackers
from roletrust_env.parameters import unknown_parameter
from roletrust_env.registry import Registry, T, explain_unknown, make_entry, parse_entry
from roletrust_env.registry import parse_parameters as parse_parameters
from roletrust_env.registry import parse_settings as parse_settings
from roletrust_env.registry import parse_value as parse_value
from roletrust_env.trust import TrustModel
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.trust.model_checks import is_own
from roletrust_env.trust.remote import KINDS as REMOTE
from roletrust_env.trust.remote import RemoteFactory
from roletrust_env.world import Scenario
from roletrust_env.world.roster import Roster

# The parameters of an attack that are places on the provider or the rater axis, and may be named.
_PROVIDERS, _RATERS = ("targets", "accomplices"), ("raters",)

# The parameters of a trust model that a field of the scenario gives it.
_SHARED = {"lam": "lam", "initial": "initial_trust"}


def value_text(text: str) -> str:
    """Return a text as a parameter's value, in quotes where it would not be read as itself.

    Example:
        >>> value_text("results/train"), value_text("a,b"), value_text("5")
        ('results/train', '"a,b"', '"5"')
    """
    plain = parse_value(text) == text and not set(text) & set("""[]{},"'""")
    return text if plain else json.dumps(text, ensure_ascii=False)


def with_settings(scenario: Scenario, settings: Mapping[str, Any]) -> Scenario:
    """Return the scenario with the settings of `--set`.

    Raises:
        ValueError: A field does not exist or a value is not allowed.
    """
    fields = [*Scenario.model_fields, "noise"]
    for field in settings:
        if field not in fields:
            raise ValueError(f"--set: there is no field {field!r}{suggest(field, fields)}")
    return scenario.change(**settings) if settings else scenario


def parse_attacks(texts: Sequence[str], scenario: Scenario) -> dict[str, Policy]:
    """Return the policies of texts of the form `AGENT=NAME:key=value,...`, by agent.

    Args:
        texts: Texts. AGENT may be a pattern such as `sr_*` or `sr_[0-2]`, NAME may be
            `package.module:Class`, and `targets`, `accomplices` and `raters` may hold names of
            agents. An attack that needs accomplices or the length of the game gets all attacking
            providers with their identities in reserve, and the length from the scenario.
        scenario: Scenario with the agents.

    Raises:
        ValueError: A text has another form, names no agent or names an agent twice, or the attack
            cannot be made.
    """
    roster, seated = Roster.of(scenario), []
    for text in texts:
        pattern, equals, attacker = text.partition("=")
        if not equals or not pattern or not attacker:
            raise ValueError(
                f"--attack has {text!r}; it must be of the form AGENT=NAME or "
                "AGENT=NAME:key=value,..."
            )
        seated.append((_agents(pattern.strip(), roster.owner_names), attacker))
    attacked = {agent for agents, _ in seated for agent in agents}
    accomplices = tuple(
        index for index, name in enumerate(roster.provider_names) if roster.owners[name] in attacked
    )
    policies: dict[str, Policy] = {}
    for agents, attacker in seated:
        registry, name, parameters = _parsed_attack(attacker, roster)
        facts = declared_facts(registry.factory(name), accomplices, scenario.max_cycles)
        _check_ring(registry.factory(name), {**facts, **parameters}, attacker)
        policy = make_entry(registry, name, {**facts, **parameters}, attacker)
        for agent in agents:
            if agent in policies:
                raise ValueError(
                    f"--attack gives agent {agent!r} two attacks; an agent has one policy"
                )
            policies[agent] = policy
    return policies


def parse_kinds(texts: Sequence[str], scenario: Scenario) -> tuple[AttackKind, ...]:
    """Return the kinds of attack of texts of the form `NAME[:key=value,...]`; their other
    parameters are searched.

    Args:
        texts: Texts as behind the `=` of `parse_attacks`.
        scenario: Scenario with the agents that `targets` and `accomplices` may name.

    Raises:
        ValueError: A text has another form, or the attack has no such parameter.
    """
    kinds, roster = [], Roster.of(scenario)
    for text in texts:
        registry, name, parameters = _parsed_attack(text, roster)
        kind = registry.factory(name)
        known = inspect.signature(kind).parameters
        for key in parameters:
            if key not in known:
                raise ValueError(unknown_parameter(f"attacker {text!r}", key, known))
        kinds.append(partial(kind, **parameters) if parameters else kind)
    return tuple(kinds)


def parse_trust_model(
    text: str, scenario: Scenario, settings: Mapping[str, Any] | None = None
) -> TrustModel[Any]:
    """Return the trust model of a text `NAME[:key=value,...]`. Arguments and errors as for
    `read_trust_model`.
    """
    registry, name, parameters = read_trust_model(text, scenario, settings)
    model: TrustModel[Any] = make_entry(registry, name, parameters, text)
    return model


def is_own_model(text: str) -> bool:
    """Return whether a text names a trust model of this project. Nothing is imported.

    Args:
        text: Text `NAME[:key=value,...]`.
    """
    factory = trust_models.registered(text.strip().partition(":")[0])
    return factory is not None and is_own(factory)


def offered_parameters(scenario: Scenario) -> dict[str, float]:
    """Return the parameters that a scenario gives a trust model, if the model accepts them."""
    return {key: getattr(scenario, field) for key, field in _SHARED.items()}


def read_trust_model(
    text: str, scenario: Scenario, settings: Mapping[str, Any] | None = None
) -> tuple[Registry[Any], str, dict[str, Any]]:
    """Return the registry of a trust model, its name there and its parameters.

    Parameters that are not given come from the scenario.

    Args:
        text: Text `NAME[:key=value,...]`; NAME may be `package.module:Class`.
        scenario: Scenario of the model, with the settings.
        settings: Fields that `--set` changes.

    Raises:
        ValueError: The name is unknown, the model has no such parameter, or the settings contradict
            the parameters.
    """
    registry, name, parameters = _parsed(trust_models, text)
    for key, field in _SHARED.items():
        if (
            key in parameters
            and field in (settings or {})
            and parameters[key] != getattr(scenario, field)
        ):
            raise ValueError(
                f"--model {text} contradicts --set {field}={getattr(scenario, field):g}; give it "
                "once"
            )
    given = registry.accepted_parameters(name, offered_parameters(scenario))
    return registry, name, {**given, **parameters}


def parse_named(registry: Registry[T], text: str, offered: Mapping[str, Any] | None = None) -> T:
    """Return the entry of a registry that `NAME:key=value,...` or
    `package.module:Class:key=value,...` names.

    Args:
        registry: Registry of the name.
        text: Text that names the entry.
        offered: Further parameters, of which the entry gets those that it accepts and that the text
            does not give.

    Raises:
        ValueError: The name is unknown, it names something of another kind, or the entry cannot be
            made.
    """
    entry, name, parameters = _parsed(registry, text)
    made: T = make_entry(
        entry, name, {**entry.accepted_parameters(name, offered or {}), **parameters}, text
    )
    return made


def named_factory(registry: Registry[T], text: str) -> Callable[..., T]:
    """Return the factory of the entry that `NAME:key=value,...` or
    `package.module:Class:key=value,...` names.

    Raises:
        ValueError: The name is unknown, or it names something of another kind.
    """
    entry, name, _ = _parsed(registry, text)
    factory: Callable[..., T] = entry.factory(name)
    return factory


def check_installed(registry: Registry[Any], texts: Sequence[str] | str) -> None:
    """Refuse names from a file that are not installed, so that a file cannot make Python import a
    module.

    Args:
        registry: Registry of the names.
        texts: Names with parameters; a single word such as `all` names nothing.

    Raises:
        ValueError: A name is not in the registry.
    """
    for text in () if isinstance(texts, str) else texts:
        name, _, rest = text.strip().partition(":")
        if name not in registry.names():
            owner = rest.partition(":")[0]
            if name not in REMOTE and (
                not owner or "=" in owner
            ):  # a name that no import can make known
                explain_unknown(registry, name)
            raise ValueError(
                f"the file names the {registry.kind} {text!r}, which is not installed; if you "
                "trust whoever wrote "
                "it, --allow-code lets it import what it names"
            )


def _parsed(registry: Registry[Any], text: str) -> tuple[Registry[Any], str, dict[str, Any]]:
    """Return what `parse_entry` does; a trust model may also be an address."""
    kind = text.strip().partition(":")[0]
    if registry is trust_models and kind in REMOTE:
        return registry.with_only(kind, RemoteFactory(text.strip())), kind, {}
    return parse_entry(registry, text)


def _parsed_attack(text: str, roster: Roster) -> tuple[Registry[Any], str, dict[str, Any]]:
    """Return the same for an attack, with names of agents replaced by indices."""
    registry, name, parameters = parse_entry(attackers, text)
    axes = (
        (_PROVIDERS, "providers", roster.provider_names),
        (_RATERS, "raters", roster.rater_names),
    )
    for keys, who, names in axes:
        for key in keys:
            if key in parameters:
                parameters[key] = _indices(key, parameters[key], who, names)
    return registry, name, parameters


def _check_ring(kind: AttackKind, parameters: Mapping[str, Any], text: str) -> None:
    """Refuse a ring of raters that has no provider to praise."""
    wanted = inspect.signature(kind).parameters.get("accomplices")
    if wanted and wanted.default is wanted.empty and "accomplices" not in parameters:
        raise ValueError(
            f"attacker {text!r} has no accomplices: seat an attack at a provider, too, such as "
            f"--attack sp_0={text}, "
            "or name them, such as accomplices=[sp_0]"
        )


def _indices(key: str, given: Any, who: str, names: Sequence[str]) -> Any:
    """Return indices, with the names of agents among them replaced, such as `[sp_1,sp_2]` or
    `sp_1`.
    """
    if isinstance(given, str):
        given = tuple(parse_value(part.strip()) for part in given.strip("[] ").split(","))
    if isinstance(given, int) and not isinstance(given, bool):
        given = (given,)
    if not isinstance(given, tuple):
        return given
    for agent in given:
        if isinstance(agent, str) and agent not in names:
            raise ValueError(f"{key} has {agent!r}; the {who} are {names[0]} ... {names[-1]}")
    return tuple(names.index(agent) if isinstance(agent, str) else agent for agent in given)


def _agents(pattern: str, names: Sequence[str]) -> list[str]:
    """Return the agents that match a pattern; a plain name is checked by the game."""
    if not any(character in pattern for character in "*?["):
        return [pattern]
    matching = [name for name in names if fnmatchcase(name, pattern)]
    if not matching:
        raise ValueError(
            f"--attack names {pattern!r}, which no agent matches; they are {names[0]} ... "
            f"{names[-1]}"
        )
    return matching
