"""Scenarios with every feature, and attackers of every kind, for the tests of attack tasks."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from game_cases import each

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Game, Random, Scenario
from roletrust_env.game.attack_task import AttackTask, Outcome, Stealth, TaskState

TOLERANCE = {"rtol": 0, "atol": 1e-12}
LEVELS = ("black_box", "grey_box", "white_box")

ACCESS = {
    "everyone": {"kind": "everyone"},
    "in-range": {"kind": "in-range", "radius": 5.0, "arena": 8.0, "speed": 1.5},
    "softmax": {"kind": "choice", "providers": 2, "temperature": 0.3},
}


def busy(access: str = "everyone", **fields: Any) -> Scenario:
    """Every feature at once. Agents: sr_0 to sr_3, sp_0 to sp_4, srsp_0 to srsp_2."""
    defaults = {
        "agents": [
            {"role": "SR", "count": 3, "noise": 0.05},
            {"role": "SP", "count": 3},
            {"role": "SR+SP", "count": 2, "noise": 0.1},
            {"role": "SR+SP", "turns": ["SR", "SP"], "turn_length": 3},
            {"role": "SR", "joins": 3, "join_rate": 0.4},
            {"role": "SP", "joins": 1, "leaves": 9},
            {"role": "SP", "leave_rate": 0.15},
        ],
        "access": ACCESS[access],
        "ratings": {"lost": 0.1, "late": 0.2, "delay": 2},
        "perturbations": [{"start": 4, "stop": 6, "strength": 0.6}],
        "values": [1.0, 2.0, 5.0],
        "admission": {"threshold": 0.3, "rounds": 4},
        "max_cycles": 14,
        "lam": 0.6,
        "initial_trust": 0.4,
    }
    return Scenario.model_validate(defaults | fields)


STEALTH = Stealth(weight=2.0, tolerance=0.05)
CASES: dict[str, dict[str, Any]] = {
    "rater": {"compromised": ("sr_1",), "stealth": STEALTH},
    "rater that joins late": {"compromised": ("sr_3",), "stealth": Stealth(1.0, 0.0)},
    "provider": {"compromised": ("sp_1",), "objective": "exploit", "stealth": STEALTH},
    "providers that leave": {"compromised": ("sp_4", "sp_3"), "objective": "exploit"},
    "dual": {"compromised": ("srsp_1",), "objective": "exploit", "stealth": STEALTH},
    "dual by turns": {
        "compromised": ("srsp_2",),
        "objective": "damage",
        "stealth": Stealth(0.5, 0.1),
    },
    "colluders among other attackers": {
        "compromised": ("sp_0", "srsp_1", "sr_0", "sr_3"),
        "stealth": STEALTH,
        "others": {
            "sp_2": OnOff(switching="random", period=5),
            "sr_2": BadMouthing(level=0.1),
            "sp_4": OnOff(),
        },
    },
    "promoters": {
        "compromised": ("sr_0", "srsp_0"),
        "objective": "promote",
        "accomplices": ("sp_3", "srsp_0", "sp_0"),
        "stealth": Stealth(1.0, 0.0),
        "others": {"sp_0": OnOff(), "sp_3": OnOff(bad=0.3)},
    },
    "no honest rater": {
        "compromised": ("sr_0", "sr_1", "sr_2", "sr_3", "srsp_0", "srsp_1", "srsp_2"),
        "stealth": STEALTH,
    },
}
EVERY_CASE = pytest.mark.parametrize("case", CASES.values(), ids=CASES)
EVERY_ACCESS = pytest.mark.parametrize("access", ACCESS)


def make(scenario: Scenario, case: dict[str, Any], like: Any = None, **changes: Any) -> AttackTask:
    arguments = case | changes
    game = Game(scenario, arguments.pop("trust_model", "role-trust"), like)
    return AttackTask(game, arguments.pop("compromised"), **arguments)


def rng(seed: int = 0, like: Any = None) -> Random:
    return Random(np.random.default_rng(seed), like)


def assert_close(actual: Any, expected: Any) -> None:
    each(
        lambda a, b: np.testing.assert_allclose(np.asarray(a), np.asarray(b), **TOLERANCE),
        actual,
        expected,
    )


def deeds(task: AttackTask, seed: int, batch: tuple[int, ...] = ()) -> list[np.ndarray]:
    """Return the actions of every round: in some games bad, in some good, in some anything."""
    random = np.random.default_rng(seed)
    shape, rounds = (task.action_size, *batch), task.game.scenario.max_cycles
    mood = random.integers(0, 3, batch)
    return [np.choose(mood, [0.2 * x, x, 1 - 0.1 * x]) for x in random.random((rounds, *shape))]


def play(
    task: AttackTask, seed: int = 0, actions: Any = None
) -> Iterator[tuple[TaskState, TaskState, Outcome]]:
    """Yield the state before, the state after and the outcome of every round of one game."""
    random = rng(seed)
    state = task.start(task.game.draw(random, start=True), random)
    for action in deeds(task, seed) if actions is None else actions:
        after, outcome = task.step(state, action, task.game.draw(random), random)
        yield state, after, outcome
        state = after
