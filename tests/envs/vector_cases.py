"""Batches to test with, and how to play them."""

from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode

from roletrust_baselines import OnOff
from roletrust_env import Scenario
from roletrust_env.envs.attack_env import TASKS
from roletrust_env.envs.vector import AttackVectorEnv

MODES = [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP]
EVERY_MODE = pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name.lower())
EVERY_TASK = pytest.mark.parametrize("task_id", TASKS)
RATER = "RoleTrust/RaterAttack-v0"
TOLERANCE = {"rtol": 0, "atol": 2e-6}

# Of eight games that rate ever better the worst are cut off, sooner or later, and the others go on
# to the end.
AGENTS = [
    {"role": "SR", "count": 4, "noise": 0.1},
    {"role": "SP", "count": 3, "ability": (0.4, 1.0), "drift": 0.1, "switch": 0.1},
    {"role": "SR+SP", "noise": 0.2},
]
ENDS = {
    "scenario": Scenario(
        agents=AGENTS,
        access={"kind": "choice", "providers": 3, "temperature": 0.5},
        ratings={"late": 0.2, "lost": 0.1, "delay": 2},
        admission={"threshold": 0.3, "rounds": 3},
        max_cycles=17,
    ),
    "compromised": ("sr_1",),
    "stealth": {"weight": 2.0, "tolerance": 0.1},
    "others": {"sp_1": OnOff(switching="random", period=6)},
    "knowledge": "white_box",
}


def lies(games: int, steps: int, size: int, seed: int = 0) -> list[np.ndarray]:
    """Return the actions of every step, (E, A): from the worst to the best, with a little of
    everything."""
    spread = np.linspace(0, 1, games)[:, None]
    random = np.random.default_rng(seed).random((steps, games, size))
    return list((0.9 * spread + 0.1 * random).astype(np.float32))


def acts(env: AttackVectorEnv, steps: int, seed: int = 0) -> list[np.ndarray]:
    return list(
        np.random.default_rng(seed).random((steps, *env.action_space.shape), dtype=np.float32)
    )


def same(a: tuple, b: tuple) -> bool:
    return data_equivalence(a, b, exact=True)


def assert_close(actual: Any, expected: Any) -> None:
    np.testing.assert_allclose(np.asarray(actual), np.asarray(expected), **TOLERANCE)
