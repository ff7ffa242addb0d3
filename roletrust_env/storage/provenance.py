"""The software, the scenario and the parameters that decide a result."""

import dataclasses
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from roletrust_env.game.game import Game
from roletrust_env.game.policy import Policy

# The packages that decide what numbers come out.
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
    """All that decides a result but the attackers: the software, the full scenario, the trust model and the seed.

    It holds no time and no host, so the same run writes the same bytes.
    """
    return {
        **software(),
        "seed": seed,
        "trust_model": described(game.model),
        "scenario": game.scenario.model_dump(mode="json"),
    }


def software() -> dict[str, Any]:
    """This package, Python and the packages that decide what numbers come out, with their versions."""
    return {
        "package": {"name": "roletrust-env", "version": version("roletrust-env")},
        "python": platform.python_version(),
        "packages": {name: found for name in _PACKAGES if (found := _version(name))},
    }


def describe_policies(attackers: Mapping[str, Policy]) -> dict[str, dict[str, Any]]:
    """Who attacks, and how."""
    return {agent: described(policy) for agent, policy in attackers.items()}


def described(thing: Any) -> dict[str, Any]:
    """The class and the parameters of a model or policy."""
    parameters = dataclasses.asdict(thing) if dataclasses.is_dataclass(thing) and not isinstance(thing, type) else {}
    return {"class": f"{type(thing).__module__}.{type(thing).__qualname__}", "parameters": parameters}


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
