"""Catalogue of scenarios, trust models, attackers and learners with their parameters, for people
and scripts.

A plug-in that cannot be loaded or read gets an entry with the reason, and does not affect the
others.
"""

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from math import isfinite
from typing import Any, get_type_hints

from roletrust_env import Policy
from roletrust_env.benchmarking.learners.learner import registry as learners
from roletrust_env.evaluation.scripts import as_spec, declared_facts, declared_ranges
from roletrust_env.evaluation.search import search_methods
from roletrust_env.game.policy import registry as attackers
from roletrust_env.parameters import Identities, SearchRange, allowed
from roletrust_env.registry import summary
from roletrust_env.trust import Traits
from roletrust_env.trust.model import registry as models
from roletrust_env.world.presets import registry as scenarios

Entry = dict[str, Any]
"""A scenario, trust model, attacker or learner as plain data; only its `error` if it cannot be
loaded or read."""


def all_scenarios() -> dict[str, Entry]:
    """Return every scenario by name, with all its fields."""
    return _entries(scenarios.names(), lambda name: scenarios.make(name).model_dump(mode="json"))


def all_models() -> dict[str, Entry]:
    """Return every trust model by name: its description, its traits and its parameters."""

    def entry(name: str) -> Entry:
        factory = models.factory(name)
        traits = Traits.of(factory if isinstance(factory, type) else models.make(name))
        facts = {
            key: getattr(traits, key)
            for key in ("family", "source", "cost", "differentiable", "rates_raters")
        }
        return {"description": summary(factory), **facts, "parameters": _parameters(factory)}

    return _entries(models.names(), entry)


def all_attackers() -> dict[str, Entry]:
    """Return every attacker by name: its description, action channels, parameters, and their search
    ranges.

    A search range is a pair of a low and a high end, a list of options, the honest providers
    ("victims"), or None for no search. The entry `given` of a parameter says that commands set it
    from the game. Channels are None if they depend on the parameters.
    """

    def entry(name: str) -> Entry:
        factory = attackers.factory(name)
        ranges, known = declared_ranges(factory), declared_facts(factory, (0,), 1)
        parameters = {
            key: {**parameter, "searched": _plain(ranges.get(key)), "given": key in known}
            for key, parameter in _parameters(factory).items()
        }
        channels = getattr(factory, "attacks", None)
        on = sorted(channels) if isinstance(channels, frozenset) else None
        return {"description": summary(factory), "channels": on, "parameters": parameters}

    return _entries(attackers.names(), entry)


def all_learners() -> dict[str, Entry]:
    """Return every learner by name: its description and its parameters.

    The search methods come first, which import the libraries that they need.
    """

    def entry(factory: Callable[..., Any]) -> Entry:
        facts = {
            "knowledge": getattr(factory, "knowledge", "black_box"),
            "known_start": getattr(factory, "known_start", False),
        }
        return {"description": summary(factory), **facts, "parameters": _parameters(factory)}

    searches = _entries(search_methods.names(), lambda name: entry(search_methods.factory(name)))
    return {**searches, **_entries(learners.names(), lambda name: entry(learners.factory(name)))}


def all_trained() -> dict[str, Entry]:
    """Return the trained attackers of the project by name: their tasks, their trainings and their
    scores.
    """
    from roletrust_agents.learned.saved import ZOO, load_attacker, zoo

    def entry(name: str) -> Entry:
        card = load_attacker(ZOO / name).card
        task, rules, training = card.task, card.scenario, card.training
        weight, tolerance = task.stealth.weight, task.stealth.tolerance
        price = f", stealth {weight:g} beyond {tolerance:g}" if weight else ""
        played = (
            f"{task.id}: {', '.join(task.compromised)} in {rules.name}, {rules.max_cycles} rounds"
        )
        learned = f"by {training.algorithm}, {training.rounds:,} rounds, seed {training.seed}"
        return {
            "description": f"{played}, {task.objective}{price}, {task.knowledge}; {learned}",
            **card.model_dump(mode="json", include={"task", "training", "score"}),
        }

    return _entries(zoo(), entry)


CATALOGUE = {
    "scenarios": all_scenarios,
    "models": all_models,
    "attackers": all_attackers,
    "learners": all_learners,
    "zoo": all_trained,
}
"""The functions that return the entries of each kind."""


def unfit(entry: Entry) -> list[str]:
    """Return the limitations of a trust model, in a few words each."""
    lacks = [] if entry["rates_raters"] else ["no trust in raters"]
    lacks += [] if entry["differentiable"] else ["trust jumps, no gradients"]
    return lacks + ([] if entry["cost"] in ("S P", "P") else [f"cost grows as {entry['cost']}"])


def where_searched(parameter: Mapping[str, Any]) -> str:
    """Return the search range of a parameter of an attacker in words; empty if there is none."""
    match parameter["searched"]:
        case {"low": low, "high": high}:
            return f"{low:g} to {high:g}"
        case {"options": options}:
            return " or ".join(map(str, options))
        case "victims":
            return "some honest providers"
        case "identities":
            return "1 to all in reserve"
    return "set by the game" if parameter["given"] else ""


def _entries(names: Iterable[str], entry: Callable[[str], Entry]) -> dict[str, Entry]:
    entries = {}
    for name in names:
        try:
            entries[name] = entry(name)
        except Exception as error:  # whatever a foreign package raises
            entries[name] = {"error": str(error) or type(error).__name__}
    return entries


def _parameters(factory: Callable[..., Any]) -> dict[str, Entry]:
    """Return the parameters of a factory, in the order of its signature.

    Each has its `default` as plain data, None also for a `required` parameter, the `allowed` values
    in words, and its `meaning` from the docstring; both are empty if they are not declared.
    """
    meanings = _meanings(factory)
    try:
        hints = get_type_hints(factory, include_extras=True)
    except Exception:  # the types of a foreign factory may be plain text
        hints = {}
    parameters = {}
    for name, parameter in inspect.signature(factory).parameters.items():
        required = parameter.default is parameter.empty
        parameters[name] = {
            "default": None if required else _as_data(parameter.default),
            "required": required,
            "allowed": allowed(hints[name]) if name in hints else "",
            "meaning": meanings.get(name, ""),
        }
    return parameters


def _meanings(factory: Callable[..., Any]) -> dict[str, str]:
    """Return what the docstrings of a factory and its bases say of each parameter, those of the
    factory first.
    """
    meanings: dict[str, str] = {}
    for base in inspect.getmro(factory) if isinstance(factory, type) else (factory,):
        section = re.search(
            r"^(?:Args|Attributes):\n((?: .*\n|\n)*)",
            f"{inspect.getdoc(base) or ''}\n",
            re.MULTILINE,
        )
        for name, text in re.findall(
            r"^    (\w+): (.*(?:\n     .*)*)", section[1] if section else "", re.MULTILINE
        ):
            meanings.setdefault(name, " ".join(text.split()))
    return meanings


def _as_data(value: Any) -> Any:
    """Return a default for JSON: a policy as on the command line, and other objects as their
    repr.
    """
    if isinstance(value, Policy):
        return as_spec(value)
    if isinstance(value, list | tuple):
        return [_as_data(item) for item in value]
    plain = (
        value is None
        or isinstance(value, bool | int | str)
        or (isinstance(value, float) and isfinite(value))
    )
    return value if plain else repr(value)


def _plain(range: Any) -> Any:
    """Return a search range as plain data."""
    if isinstance(range, SearchRange):
        return {"low": range.low, "high": range.high}
    if isinstance(range, tuple):
        return {"options": list(range)}
    if isinstance(range, Identities):
        return "identities"
    return None if range is None else "victims"
