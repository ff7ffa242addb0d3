"""What the Gymnasium tasks refuse, and that refusing changes nothing."""

from typing import Any

import numpy as np
import pytest
import torch
from refusals import refuses
from task_cases import EVERY_TASK, RATER, acts, make, same

from roletrust_baselines import BadMouthing
from roletrust_env import Scenario
from roletrust_env.envs.attack_env import AttackEnv


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"scenario": "paper3x3"}, ["scenario", "paper3x3", "paper-3x3"]),
        ({"scenario": None}, ["scenario", "None"]),
        ({"trust_model": "role-turst"}, ["role-turst", "role-trust"]),
        ({"compromised": ("sr_7",)}, ["compromised", "sr_7", "sr_0"]),
        ({"compromised": ("sr_0", "sr_0")}, ["compromised", "sr_0"]),
        ({"compromised": ()}, ["compromised"]),
        ({"objective": "harm"}, ["objective", "harm", "damage"]),
        ({"knowledge": "all"}, ["knowledge", "all", "grey_box"]),
        ({"others": {"sr_9": BadMouthing()}}, ["sr_9", "sr_0"]),
        ({"others": {"sr_2": BadMouthing()}}, ["sr_2", "compromised"]),
        ({"render_mode": "hologram"}, ["render_mode", "hologram", "human", "rgb_array", "ansi"]),
        ({"lam": 1.0}, ["lam", "1.0", "[0.5, 1)"]),
        ({"stealth": {"weight": -1.0}}, ["weight", "-1.0"]),
        ({"stealth": {"weight": float("nan")}}, ["weight", "nan"]),
        ({"stealth": {"weight": float("inf")}}, ["weight", "inf"]),
        ({"stealth": {"weight": "much"}}, ["weight", "much"]),
        ({"stealth": {"tolerance": 2.0}}, ["tolerance", "2.0", "[0, 1]"]),
        ({"stealth": {"wieght": 2.0}}, ["wieght", "weight", "tolerance"]),
        ({"stealth": 2.0}, ["stealth", "2.0"]),
        ({"like": torch.zeros(())}, ["like"]),  # this face is NumPy's
    ],
    ids=str,
)
def test_bad_arguments_are_refused(arguments: dict, words: list[str]) -> None:
    with refuses(ValueError, *words):
        make(RATER, **arguments)


def started(**arguments: Any) -> AttackEnv:
    env = make(RATER, noise=0.1, knowledge="white_box", **arguments)
    env.reset(seed=4)
    for action in acts(env, 2):
        env.step(action)
    return env


@pytest.mark.parametrize(
    ("action", "words"),
    [
        pytest.param([0.5, np.nan, 0.5], ["nan", "[0, 1]"], id="NaN"),
        pytest.param([0.5, np.inf, 0.5], ["inf", "[0, 1]"], id="inf"),
        pytest.param([0.5, 1.25, 0.5], ["1.25", "[0, 1]"], id="too large"),
        pytest.param([0.5, 0.5, -0.25], ["-0.25", "[0, 1]"], id="too small"),
        pytest.param(np.zeros(2), ["(2,)", "(3,)"], id="too short"),
        pytest.param(np.zeros(4), ["(4,)", "(3,)"], id="too long"),
        pytest.param(np.zeros((1, 3)), ["(1, 3)", "(3,)"], id="two axes"),
        pytest.param(0.5, ["()", "(3,)"], id="a number"),
        pytest.param(None, ["(3,)"], id="None"),
        pytest.param(["0.1", "0.2", "0.3"], ["(3,)"], id="strings"),
        pytest.param(np.zeros(3, complex), ["complex128"], id="complex"),
        pytest.param([None] * 3, ["object"], id="an array of None"),
        pytest.param(np.ma.masked_equal([0.5, 0.5, 0.0], 0.0), ["masked"], id="a masked entry"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_a_bad_action_is_refused_and_changes_nothing(action: Any, words: list[str]) -> None:
    env, twin = started(), started()
    with refuses(ValueError, "action", *words):
        env.step(action)
    for good in acts(env, 3, 9):
        assert same(env.step(good), twin.step(good))


@pytest.mark.parametrize("dtype", [np.float64, np.float16, np.int64])
def test_numbers_of_any_precision_are_taken(dtype: type) -> None:
    env, twin = started(), started()
    assert same(env.step(np.ones(3, dtype)), twin.step(np.ones(3, np.float32)))
    assert same(env.step([0, 0.5, 1]), twin.step(np.array([0, 0.5, 1], np.float32)))


@EVERY_TASK
def test_there_is_no_step_before_the_first_reset(task_id: str) -> None:
    env = make(task_id)
    with refuses(RuntimeError, "reset()"):
        env.step(acts(env, 1)[0])
    env.reset(seed=0)
    env.step(acts(env, 1)[0])


@pytest.mark.parametrize("caught", [False, True], ids=["truncated", "terminated"])
def test_there_is_no_step_after_the_end(caught: bool) -> None:
    agents = [
        {"role": "SR"},
        {"role": "SR", "leaves": 3 if caught else None, "noise": 0.1},
        {"role": "SP"},
    ]
    scenario = Scenario(agents=agents, max_cycles=5 if caught else 3)
    env, twin = (make(RATER, scenario=scenario, compromised=("sr_1",)) for _ in range(2))
    for one in (env, twin):
        one.reset(seed=0)
        ends = [one.step(np.ones(1, np.float32))[2:4] for _ in range(3)]
        assert ends[-1] == (caught, not caught)
    for _ in range(2):
        with refuses(RuntimeError, "reset()"):
            env.step(np.ones(1, np.float32))
    assert same(env.reset(), twin.reset())
    assert same(env.step(np.ones(1, np.float32)), twin.step(np.ones(1, np.float32)))
