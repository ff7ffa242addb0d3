"""RoleTrust: an environment in which role-based trust models are attacked and measured."""

from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import pettingzoo

from roletrust_env.envs.aec import env
from roletrust_env.envs.parallel import RoleTrustParallelEnv, parallel_env
from roletrust_env.envs.vector import register_tasks
from roletrust_env.envs.wrappers import EachAgent, Everybody, Levels, Scaled
from roletrust_env.game.attack_task import make_task
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy, Player
from roletrust_env.game.policy import Policy
from roletrust_env.game.policy_registry import attackers, make_attacker, register_attacker
from roletrust_env.game.rollout import record
from roletrust_env.game.state import Actions, Noise, State
from roletrust_env.randomness import Random
from roletrust_env.trust import make_trust_model, register_trust_model, trust_models
from roletrust_env.world import Scenario, load_scenario, make_scenario, register_scenario, scenarios

if TYPE_CHECKING:
    from roletrust_env.envs.sb3 import AttackVecEnv, RoleVecEnv

__version__ = version("roletrust-env")

pettingzoo.register("parallel", "RoleTrust-v0", parallel_env)
pettingzoo.register("aec", "RoleTrust-v0", env)
register_tasks()

__all__ = [
    "Actions",
    "AttackVecEnv",
    "EachAgent",
    "Everybody",
    "Game",
    "JointPolicy",
    "Levels",
    "Noise",
    "Player",
    "Policy",
    "Random",
    "RoleTrustParallelEnv",
    "RoleVecEnv",
    "Scaled",
    "Scenario",
    "State",
    "attackers",
    "env",
    "load_scenario",
    "make_attacker",
    "make_scenario",
    "make_task",
    "make_trust_model",
    "parallel_env",
    "record",
    "register_attacker",
    "register_scenario",
    "register_trust_model",
    "scenarios",
    "trust_models",
]


def __getattr__(name: str) -> Any:
    """The faces for Stable-Baselines3, which is imported only when they are asked for."""
    if name in ("AttackVecEnv", "RoleVecEnv"):
        from roletrust_env.envs import sb3

        return getattr(sb3, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
