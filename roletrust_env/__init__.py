"""RoleTrust: an environment in which role-based trust models are attacked and measured.

Plug-in authors find checks of their trust models and attacks in `roletrust_env.testing`.
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium
import pettingzoo

pettingzoo.register("parallel", "RoleTrust-v0", "roletrust_env.envs.parallel:parallel_env")
pettingzoo.register("aec", "RoleTrust-v0", "roletrust_env.envs.aec:env")
for _task in ("ProviderAttack", "RaterAttack", "DualAttack", "CollusionAttack"):
    gymnasium.register(
        f"RoleTrust/{_task}-v0",
        entry_point=f"roletrust_env.envs.attack_env:{_task}Env",
        vector_entry_point=f"roletrust_env.envs.vector:{_task}VectorEnv",
    )

_MODULES: dict[str, str] = {
    alias.name: node.module or ""
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_bytes()).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}
"""Module of each public name, from the stub, which type checkers read, too."""

__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    """Return a public name, whose module is imported now.

    Raises:
        DependencyNotInstalled: It needs Stable-Baselines3 or JAX, which is missing. The class is that of Gymnasium.
    """
    if name == "__version__":
        from importlib.metadata import version

        return version("roletrust-env")
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if _MODULES[name] == __name__:
        return import_module(f"{__name__}.{name}")
    try:
        found = getattr(import_module(_MODULES[name]), name)
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        needed = {"stable_baselines3": ("Stable-Baselines3", "train"), "jax": ("JAX", "jax")}
        library, extra = needed.get("stable_baselines3" if missing == "torch" else missing, ("", ""))
        if not library:
            raise
        raise gymnasium.error.DependencyNotInstalled(
            f"{name} needs {library}, and {missing} is not installed: pip install 'roletrust-env[{extra}]'"
        ) from None
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted([*__all__, "__version__"])
