"""The world: scenarios, who is there, who serves whom, and what is perceived."""

from roletrust_env.world.group import AgentGroup
from roletrust_env.world.presets import make_scenario, register_scenario, scenarios
from roletrust_env.world.scenario import (
    Admission,
    Choice,
    Everyone,
    InRange,
    Perturbation,
    RatingChannel,
    Rewards,
    Scenario,
    load_scenario,
)

__all__ = [
    "Admission",
    "AgentGroup",
    "Choice",
    "Everyone",
    "InRange",
    "Perturbation",
    "RatingChannel",
    "Rewards",
    "Scenario",
    "load_scenario",
    "make_scenario",
    "register_scenario",
    "scenarios",
]
