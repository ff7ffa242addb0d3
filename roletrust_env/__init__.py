"""RoleTrust: an environment in which role-based trust models are attacked and measured."""

from importlib.metadata import version

import pettingzoo

from roletrust_env.game import Game
from roletrust_env.parallel import RoleTrustParallelEnv, env, parallel_env
from roletrust_env.policy import Cast, Player, Policy
from roletrust_env.randomness import Random
from roletrust_env.state import Actions, Noise, State
from roletrust_env.trust import make_trust_model, register_trust_model, trust_models
from roletrust_env.vector import register_tasks
from roletrust_env.world import Scenario, load_scenario, make_scenario, register_scenario, scenarios

__version__ = version("roletrust-env")

pettingzoo.register("parallel", "RoleTrust-v0", parallel_env)
pettingzoo.register("aec", "RoleTrust-v0", env)
register_tasks()

__all__ = [
    "Actions",
    "Cast",
    "Game",
    "Noise",
    "Player",
    "Policy",
    "Random",
    "RoleTrustParallelEnv",
    "Scenario",
    "State",
    "env",
    "load_scenario",
    "make_scenario",
    "make_trust_model",
    "parallel_env",
    "register_scenario",
    "register_trust_model",
    "scenarios",
    "trust_models",
]
