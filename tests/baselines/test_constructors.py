"""Constructors of attackers, trust models, search methods and scenarios refuse parameters that do
not exist."""

import dataclasses
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from refusals import refuses

import roletrust_agents
import roletrust_baselines
import roletrust_env.world
from roletrust_agents.planning.optimum import BestKnown, Exact
from roletrust_agents.planning.planner import Planner
from roletrust_baselines.search import CmaEs, PaperAttacks, RandomSearch
from roletrust_env import attackers, make_attacker, trust_models
from roletrust_env.game.policy import Policy
from roletrust_env.game.policy import registry as attacker_registry
from roletrust_env.parameters import UnknownParameterError
from roletrust_env.trust.model import registry as model_registry
from roletrust_env.world.group import FrozenModel

SEARCH_METHODS = (PaperAttacks, RandomSearch, CmaEs, Planner, Exact, BestKnown)
FACTORIES = {
    **{name: attacker_registry.factory(name) for name in attackers() if name != "learned"},
    **{name: model_registry.factory(name) for name in trust_models() if name != "doubt"},
    **{method.__name__: method for method in SEARCH_METHODS},
}
SCENARIO_PARTS = [
    part
    for part in vars(roletrust_env.world).values()
    if isinstance(part, type) and issubclass(part, FrozenModel)
]


def misspelt(name: str) -> str:
    """Return a name with two letters swapped, or with a letter too many."""
    return (
        f"{name}x"
        if len(name) < 3 or name[1] == name[2]
        else name[0] + name[2] + name[1] + name[3:]
    )


def policies() -> Iterator[type[Any]]:
    """All dataclasses of policies in the packages of attackers, base classes included."""
    for package in (roletrust_baselines, roletrust_agents):
        for module in pkgutil.walk_packages(
            [str(Path(package.__path__[0]))], f"{package.__name__}."
        ):
            for cls in vars(importlib.import_module(module.name)).values():
                own = (
                    isinstance(cls, type)
                    and issubclass(cls, Policy)
                    and cls.__module__ == module.name
                )
                if own and dataclasses.is_dataclass(cls):
                    yield cls


@pytest.mark.parametrize("name", FACTORIES)
def test_an_unknown_parameter_is_refused_and_the_near_name_suggested(name: str) -> None:
    factory = FACTORIES[name]
    parameters = list(inspect.signature(factory).parameters)
    with refuses(UnknownParameterError, "zzz"):
        factory(zzz=0.5)
    for parameter in parameters:
        with refuses(UnknownParameterError, parameter, parameters[0]):
            factory(**{misspelt(parameter): 0.5})


@pytest.mark.parametrize(
    "cls", sorted(set(policies()), key=lambda cls: cls.__name__), ids=lambda cls: cls.__name__
)
def test_every_policy_refuses_unknown_parameters(cls: type[Any]) -> None:
    with refuses(UnknownParameterError, "zzz", cls.__name__):
        cls(zzz=0.5)


def test_the_registry_of_attackers_suggests_in_one_line() -> None:
    with refuses(ValueError, "bad-mouthing", "levl", "level"):
        make_attacker("bad-mouthing", levl=0.2)


@pytest.mark.parametrize("part", SCENARIO_PARTS, ids=lambda part: part.__name__)
def test_every_part_of_a_scenario_suggests_the_near_field(part: type[FrozenModel]) -> None:
    for field in part.model_fields:
        with refuses(ValidationError, misspelt(field), field):
            part(**{misspelt(field): 1})
    with refuses(ValidationError, "zzz", field):
        part(zzz=1)
