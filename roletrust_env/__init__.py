"""RoleTrust: an environment in which role-based trust models are attacked and measured.

Plug-in authors find checks of their trust models and attacks in `roletrust_env.testing`.
"""

import ast
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium
import pettingzoo

from roletrust_env.envs.spec import TaskSpec

pettingzoo.register("parallel", "RoleTrust-v0", "roletrust_env.envs.parallel:parallel_env")
pettingzoo.register("aec", "RoleTrust-v0", "roletrust_env.envs.aec:env")
for _task in ("ProviderAttack", "RaterAttack", "DualAttack", "CollusionAttack"):
    _id = f"RoleTrust/{_task}-v0"
    gymnasium.register(
        _id,
        entry_point=f"roletrust_env.envs.attack_env:{_task}Env",
        vector_entry_point=f"roletrust_env.envs.vector:{_task}VectorEnv",
    )
    gymnasium.registry[_id] = TaskSpec.of(
        gymnasium.registry[_id]
    )  # vector environments of Gymnasium copy it

_MODULES: dict[str, str] = {
    alias.name: node.module or ""
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_bytes()).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}
"""Module of each public name, from the stub, which type checkers read, too."""

_EXTRAS = {
    "roletrust_env.envs.sb3": ("stable_baselines3", "train"),
    "roletrust_env.envs.jax_env": ("jax", "jax"),
    "roletrust_env.benchmarking": ("filelock", "train"),
}
"""Package that a module needs, and the extra that installs it."""


def _installed(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except ImportError:
        return False


__all__ = sorted(
    name
    for name, module in _MODULES.items()
    if module not in _EXTRAS or _installed(_EXTRAS[module][0])
)
"""Public names that can be imported, so that `from roletrust_env import *` and `help` work without
extras."""


class DependencyNotInstalled(gymnasium.error.DependencyNotInstalled, AttributeError):  # noqa: N818 - as Gymnasium has it
    """The package that a public name needs is missing, so that `hasattr` is false."""


def __getattr__(name: str) -> Any:
    """Return a public name, whose module is imported now.

    Raises:
        AttributeError: There is no such name, or the extra that it needs is missing. Then it is a
            `DependencyNotInstalled` of Gymnasium, too.
    """
    if name == "__version__":
        from importlib.metadata import version

        return version("roletrust-env")
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if _MODULES[name] == __name__:
        return import_module(f"{__name__}.{name}")
    module = _MODULES[name]
    try:
        value = getattr(import_module(module), name)
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if module not in _EXTRAS or missing == __name__:
            raise
        hint = (
            f"{name} needs {missing}, which is not installed: pip install "
            f"'roletrust-env[{_EXTRAS[module][1]}]'"
        )
        # `from roletrust_env import NAME` asks first and would hide an AttributeError with its
        # hint.
        asked = sys._getframe(1).f_code.co_name == "_handle_fromlist"
        raise (gymnasium.error.DependencyNotInstalled if asked else DependencyNotInstalled)(
            hint
        ) from None
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted([*__all__, "__version__"])
