"""RoleTrust: an environment in which role-based trust models are attacked and measured.

Plug-in authors find checks of their trust models and attacks in `roletrust_env.testing`.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import pettingzoo
from gymnasium.error import DependencyNotInstalled

from roletrust_env import metrics
from roletrust_env.envs.aec import env
from roletrust_env.envs.parallel import RoleTrustParallelEnv, parallel_env
from roletrust_env.envs.vector import register_tasks
from roletrust_env.envs.wrappers import DiscretizeLevels, FixedAgents, ParallelTransformAction, RescaleClipAction
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy, Player
from roletrust_env.game.make_task import make_task
from roletrust_env.game.policy import Policy
from roletrust_env.game.policy_registry import attackers, make_attacker, register_attacker
from roletrust_env.game.rollout import History, record
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.sparse import SparseGame
from roletrust_env.game.state import Actions, Noise, State
from roletrust_env.randomness import Random
from roletrust_env.trust import TrustModel, make_trust_model, register_trust_model, trust_models
from roletrust_env.world import Scenario, load_scenario, make_scenario, register_scenario, scenarios

if TYPE_CHECKING:
    from roletrust_env.benchmarking import benchmark
    from roletrust_env.data import TrustStream
    from roletrust_env.envs.sb3 import AttackVecEnv, RoleVecEnv
    from roletrust_env.evaluation.evaluate import evaluate

__version__ = version("roletrust-env")

pettingzoo.register("parallel", "RoleTrust-v0", parallel_env)
pettingzoo.register("aec", "RoleTrust-v0", env)
register_tasks()

__all__ = [
    "Actions",
    "AttackTask",
    "AttackVecEnv",
    "DiscretizeLevels",
    "FixedAgents",
    "Game",
    "History",
    "JointPolicy",
    "Noise",
    "ParallelTransformAction",
    "Player",
    "Policy",
    "Random",
    "RescaleClipAction",
    "RoleTrustParallelEnv",
    "RoleVecEnv",
    "Scenario",
    "SparseGame",
    "State",
    "TrustModel",
    "TrustStream",
    "WindowedAttack",
    "attackers",
    "benchmark",
    "env",
    "evaluate",
    "load_scenario",
    "make_attacker",
    "make_scenario",
    "make_task",
    "make_trust_model",
    "metrics",
    "parallel_env",
    "record",
    "register_attacker",
    "register_scenario",
    "register_trust_model",
    "scenarios",
    "trust_models",
]

_LATE = {
    "TrustStream": "roletrust_env.data",
    "benchmark": "roletrust_env.benchmarking",
    "evaluate": "roletrust_env.evaluation",
}


def __getattr__(name: str) -> Any:
    """Return what is imported only when it is needed, such as `benchmark`, or an environment for Stable-Baselines3.

    Raises:
        DependencyNotInstalled: Stable-Baselines3 is missing. The class is that of Gymnasium.
    """
    if name in _LATE:
        return getattr(import_module(_LATE[name]), name)
    if name not in ("AttackVecEnv", "RoleVecEnv"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        from roletrust_env.envs import sb3
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing not in ("stable_baselines3", "torch"):
            raise
        raise DependencyNotInstalled(
            f"{name} needs Stable-Baselines3, and {missing} is not installed: pip install 'roletrust-env[train]'"
        ) from None
    return getattr(sb3, name)


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted([*__all__, "__version__"])
