"""Tasks to test with: every task in every scenario that has somebody for it, and how to play
them."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

import roletrust_env
from roletrust_env import make_scenario
from roletrust_env.envs.attack_env import TASKS, AttackEnv
from roletrust_env.world.roster import Roster

PRESETS = [name for name in roletrust_env.scenarios() if "hog" not in name and name != "city"]
LEVELS = ("black_box", "grey_box", "white_box")
PROVIDER, RATER, DUAL, COLLUSION = TASKS


def crew(task_id: str, scenario: str) -> tuple[str, ...]:
    """Agents of a scenario that a task is about; none if it has none."""
    names = Roster.of(make_scenario(scenario)).names
    of = {
        role: [name for name in names if name.startswith(role + "_")]
        for role in ("sr", "sp", "srsp")
    }
    if task_id == COLLUSION:
        return tuple(name for members in of.values() for name in members[-2:])
    return tuple({PROVIDER: of["sp"], RATER: of["sr"], DUAL: of["srsp"]}[task_id][-1:])


CASES = [
    pytest.param(task_id, scenario, level, id=f"{task_id}-{scenario}-{level}")
    for task_id in TASKS
    for scenario in PRESETS
    for level in LEVELS
    if crew(task_id, scenario)
]
EVERY_TASK = pytest.mark.parametrize("task_id", TASKS)


def make(task_id: str, **arguments: Any) -> AttackEnv:
    return TASKS[task_id](**arguments)


def acts(env: gymnasium.Env, n: int, seed: int = 0) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).random((n, *env.action_space.shape), dtype=np.float32))


def same(a: tuple, b: tuple) -> bool:
    """Return whether two steps or resets are the same to the last bit."""
    return data_equivalence(a, b, exact=True)
