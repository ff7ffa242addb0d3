"""Provenance of a result: the software, the scenario and the parameters that determine it."""

import dataclasses
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from roletrust_env.game.game import Game
from roletrust_env.game.policy import Policy

# Packages that affect the numbers of a result.
_PACKAGES = (
    "numpy",
    "opencv-python-headless",
    "array-api-compat",
    "gymnasium",
    "pettingzoo",
    "pydantic",
    "torch",
    "stable-baselines3",
    "scipy",
    "cma",
)


def provenance(game: Game, seed: int) -> dict[str, Any]:
    """Return everything that determines a result except the attackers: software, scenario, trust
    model and seed.

    It has no time and no host name, so the same run writes the same bytes.
    """
    return {
        **software(),
        "seed": seed,
        "trust_model": describe(game.model),
        "scenario": game.scenario.model_dump(mode="json"),
    }


def software() -> dict[str, Any]:
    """Return the versions of this package, of Python, and of the packages that affect the numbers
    of a result.
    """
    return {
        "package": {"name": "roletrust-env", "version": version("roletrust-env")},
        "python": platform.python_version(),
        "packages": {name: number for name in _PACKAGES if (number := _version(name))},
    }


def describe_policies(attackers: Mapping[str, Policy]) -> dict[str, dict[str, Any]]:
    """Return the class and the parameters of each attacker's policy."""
    return {agent: describe(policy) for agent, policy in attackers.items()}


def describe(thing: Any) -> dict[str, Any]:
    """Return the class and the parameters of a model or policy."""
    parameters = (
        dataclasses.asdict(thing)
        if dataclasses.is_dataclass(thing) and not isinstance(thing, type)
        else {}
    )
    return {
        "class": f"{type(thing).__module__}.{type(thing).__qualname__}",
        "parameters": parameters,
    }


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
