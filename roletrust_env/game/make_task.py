"""Attack tasks by the names of their parts."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from roletrust_env.arrays import Array
from roletrust_env.errors import suggest
from roletrust_env.game.attack_task import (
    AttackTask,
    Consumers,
    Knowledge,
    Objective,
    Stealth,
    make_stealth,
)
from roletrust_env.game.coalition_task import CoalitionTask
from roletrust_env.game.game import Game
from roletrust_env.game.policy import Policy
from roletrust_env.game.policy import registry as policies
from roletrust_env.trust import TrustModel
from roletrust_env.world import Scenario, make_scenario

Observation = Literal["agents", "coalition", "accounts"]
"""What an attacker observes and decides: agent by agent; provider by provider for the coalition as
one mind; or also rater by rater, by the accounts that its providers keep."""


def make_task(
    scenario: str | Path | Scenario,
    compromised: Sequence[str],
    *,
    trust_model: str | TrustModel[Any] | Mapping[str, Any] = "role-trust",
    objective: Objective = "damage",
    stealth: Stealth | Mapping[str, float] | None = None,
    knowledge: Knowledge = "black_box",
    others: Mapping[str, Policy | Mapping[str, Any]] | None = None,
    accomplices: Sequence[str] = (),
    consumers: Consumers = "public",
    observation: Observation = "agents",
    like: Array | None = None,
    **changes: Any,
) -> AttackTask:
    """Make an attack task.

    Args:
        scenario: Name of a preset, path of a TOML or YAML file, or a `Scenario`.
        compromised: Names of the agents that the attacker controls.
        trust_model: Name of a trust model, or a model, or a table of its name and parameters.
        objective: `"damage"`, `"exploit"`, `"promote"` or `"mislead"`, see `AttackTask`.
        stealth: Price of a trust gap, `{"weight": ..., "tolerance": ...}`; None is free.
        knowledge: `"black_box"`, `"grey_box"` or `"white_box"`, see `AttackTask.observe`.
        others: Policies of further agents by name, which are neither compromised nor honest, or
            tables of their names and parameters.
        accomplices: Names of the providers of `"promote"`.
        consumers: Who consumes, `"public"`, `"raters"` or `"received"`, see `AttackTask`.
        observation: `"agents"`, the observations and actions of the compromised agents one by one,
            see `AttackTask`; or `"coalition"`, features and a decision for each provider; or
            `"accounts"`, a wide coalition, see `CoalitionTask`.
        like: Array of the library, dtype and device to play with; by default NumPy's float32.
        **changes: Other values of fields of the scenario, such as `max_cycles=200` or `noise=0.0`.

    Raises:
        ValueError: A name is unknown or a value is not allowed.
    """
    scenario = make_scenario(scenario)
    scenario = scenario.change(**changes) if changes else scenario
    game = Game(scenario, trust_model, np.zeros((), np.float32) if like is None else like)
    if observation not in get_args(Observation):
        raise ValueError(
            f"unknown observation {observation!r}{suggest(observation, get_args(Observation))}"
        )
    options: dict[str, Any] = {
        "objective": objective,
        "stealth": make_stealth(stealth),
        "knowledge": knowledge,
        "others": {
            k: policies.read(policy) if isinstance(policy, Mapping) else policy
            for k, policy in (others or {}).items()
        },
        "accomplices": accomplices,
        "consumers": consumers,
    }
    if observation == "agents":
        return AttackTask(game, compromised, **options)
    return CoalitionTask(game, compromised, wide=observation == "accounts", **options)
