"""What the batched face refuses, and that refusing changes nothing."""

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from refusals import refuses
from slow_vector import GAMES
from vector_cases import ENDS, RATER, acts, lies, same

from roletrust_env.envs.vector import AttackVectorEnv


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"task_id": "RoleTrust/RaterAtack-v0"}, ["RoleTrust/RaterAtack-v0", RATER]),
        ({"num_envs": 0}, ["num_envs", "0"]),
        ({"num_envs": -3}, ["num_envs", "-3"]),
        ({"num_envs": 2.5}, ["num_envs", "2.5"]),
        ({"autoreset_mode": "next"}, ["autoreset_mode", "next", "NEXT_STEP"]),
        ({"compromised": ("sr_9",)}, ["compromised", "sr_9", "sr_0"]),
        ({"compromised": ("sr_1", "sr_1")}, ["compromised", "sr_1"]),
        ({"knowledge": "all"}, ["knowledge", "all", "black_box"]),
        ({"max_episode_steps": 0}, ["max_episode_steps", "0"]),
        ({"max_episode_steps": 2.5}, ["max_episode_steps", "2.5"]),
        (
            {"autoreset_mode": "Never"},
            ["autoreset_mode", "Never", "NextStep", "SameStep", "Disabled"],
        ),
        ({"render_mode": "hologram"}, ["render_mode", "hologram", "human", "rgb_array", "ansi"]),
    ],
    ids=str,
)
def test_bad_arguments_are_refused(arguments: dict, words: list[str]) -> None:
    with refuses(ValueError, *words):
        AttackVectorEnv(**{"task_id": RATER, "num_envs": 2} | arguments)


def test_no_games_are_refused_by_make_vec() -> None:
    with refuses(ValueError, "num_envs", "0"):
        gymnasium.make_vec(RATER, num_envs=0)


def at_the_boundary(like: Any = None) -> AttackVectorEnv:
    """Some games are to be restarted in the next step."""
    batch = AttackVectorEnv(RATER, GAMES, like=like, **ENDS)
    batch.reset(seed=4)
    for actions in lies(GAMES, 40, 4):
        *_, terminations, truncations, _ = batch.step(actions)
        if terminations.any() and not (terminations | truncations).all():
            return batch
    raise AssertionError


def spoilt(value: Any) -> np.ndarray:
    actions = np.full((GAMES, 4), 0.5)
    actions[-1, 2] = value
    return actions


@pytest.mark.parametrize("tensors", [False, True], ids=["numpy", "torch"])
def test_bad_actions_are_refused_and_change_nothing(tensors: bool) -> None:
    like = torch.zeros(()) if tensors else None
    batch, twin = at_the_boundary(like), at_the_boundary(like)
    off = [spoilt(value) for value in (np.nan, np.inf, 1.25, -0.25)]
    misshapen = [np.zeros((4, GAMES)), np.zeros((GAMES + 1, 4)), np.zeros(4), 0.5, None, "worst"]
    for actions in (*off, *misshapen):
        with refuses(ValueError, "action"):
            batch.step(actions)
    for good in lies(GAMES, 5, 4, 9):
        for part, value in zip(batch.step(good)[:4], twin.step(good)[:4], strict=True):
            assert np.array_equal(part, value)


@pytest.mark.parametrize(
    "mask",
    [
        pytest.param(np.full(GAMES + 1, True), id="too long"),
        pytest.param(np.full((GAMES, 1), True), id="two axes"),
        pytest.param(np.ones(GAMES), id="numbers"),
        pytest.param(np.full(GAMES, False), id="nobody"),
        pytest.param(True, id="a flag"),
    ],
)
def test_a_bad_mask_is_refused_and_changes_nothing(mask: Any) -> None:
    batch, twin = at_the_boundary(), at_the_boundary()
    with refuses(ValueError, "reset_mask", "(8,)", GAMES):
        batch.reset(seed=9, options={"reset_mask": mask})
    for good in lies(GAMES, 5, 4, 9):
        assert same(batch.step(good), twin.step(good))


@pytest.mark.parametrize("seed", [[1] * GAMES, [None] * GAMES, (1, 2)], ids=str)
def test_a_list_of_seeds_is_refused_and_changes_nothing(seed: Any) -> None:
    batch, twin = at_the_boundary(), at_the_boundary()
    with refuses(ValueError, "seed"):
        batch.reset(seed=seed)
    for good in lies(GAMES, 5, 4, 9):
        assert same(batch.step(good), twin.step(good))


def test_there_is_no_step_before_the_first_reset() -> None:
    batch = AttackVectorEnv(RATER, 2)
    with refuses(RuntimeError, "reset()"):
        batch.step(acts(batch, 1)[0])
    with refuses(RuntimeError, "reset()"):
        batch.reset(options={"reset_mask": np.array([True, False])})
