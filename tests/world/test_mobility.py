"""Robots that move."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from roletrust_env.world import InRange
from roletrust_env.world.mobility import Motion, move, scatter

RULE = InRange(arena=8.0, speed=0.5)
NAMESPACES = pytest.mark.parametrize("asarray", [np.asarray, torch.asarray], ids=["numpy", "torch"])


@NAMESPACES
def test_a_robot_walks_straight_to_its_goal_and_then_to_the_next(asarray: Callable) -> None:
    motion = Motion(asarray([[1.0, 1.0]]), asarray([[1.6, 1.8]]))  # a metre away: two rounds
    following = asarray([[0.25, 0.75]])
    first = move(RULE, motion, following)
    np.testing.assert_allclose(first.position, [[1.3, 1.4]])
    np.testing.assert_allclose(first.goal, [[1.6, 1.8]])
    assert float(motion.position[0, 0]) == 1.0
    second = move(RULE, first, following)
    np.testing.assert_allclose(second.position, [[1.6, 1.8]])
    third = move(RULE, second, following)
    np.testing.assert_allclose(third.goal, [[2.0, 6.0]])


def test_a_robot_that_just_reaches_its_goal_has_the_next() -> None:
    there = move(
        RULE, Motion(np.array([[1.0, 1.0]]), np.array([[1.5, 1.0]])), np.array([[0.25, 0.75]])
    )
    assert there.position.tolist() == [[1.5, 1.0]]
    assert there.goal.tolist() == [[2.0, 6.0]]


@pytest.mark.parametrize("speed", [0.0, 0.01, 0.5, 3.0, 100.0])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_robots_stay_in_the_arena_and_within_their_speed(speed: float, dtype: type) -> None:
    rule, rng = InRange(arena=7.3, speed=speed), np.random.default_rng(0)
    motion = scatter(rule, *rng.random((2, 40, 2, 5), dtype=dtype))
    for _ in range(60):
        goal = np.where(
            rng.random((40, 2, 5)) < 0.2, np.nextafter(dtype(1), dtype(0)), rng.random((40, 2, 5))
        )
        after = move(rule, motion, goal.astype(dtype))
        stride = np.hypot(*np.moveaxis(after.position - motion.position, 1, 0))
        assert np.all(stride <= speed * (1 + 1e-5) + 1e-6)
        assert np.all((after.position >= 0) & (after.position / dtype(rule.arena) <= 1))
        assert after.position.dtype == after.goal.dtype == dtype
        motion = after


@NAMESPACES
def test_robots_move_apart_from_each_other(asarray: Callable) -> None:
    rng = np.random.default_rng(0)
    position, goal, following = rng.random((3, 4, 2, 3))
    many = move(RULE, scatter(RULE, asarray(position), asarray(goal)), asarray(following))
    for n in range(4):
        for e in range(3):
            one = scatter(RULE, asarray(position[n : n + 1, :, e]), asarray(goal[n : n + 1, :, e]))
            np.testing.assert_allclose(
                move(RULE, one, asarray(following[n : n + 1, :, e]))[0][0], many[0][n, :, e]
            )
