"""World: scenarios, presence of agents, access to services, and perception of their quality."""

from roletrust_env.world.group import AgentGroup
from roletrust_env.world.presets import make_scenario, register_scenario, scenarios
from roletrust_env.world.scenario import (
    Admission,
    Choice,
    Encounters,
    Everyone,
    InRange,
    Perturbation,
    RatingDelivery,
    Rewards,
    Scenario,
    load_scenario,
)

__all__ = [
    "Admission",
    "AgentGroup",
    "Choice",
    "Encounters",
    "Everyone",
    "InRange",
    "Perturbation",
    "RatingDelivery",
    "Rewards",
    "Scenario",
    "load_scenario",
    "make_scenario",
    "register_scenario",
    "scenarios",
]
