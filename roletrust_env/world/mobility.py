"""Moving robots: the random-waypoint model in a square arena."""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.shapes import Shape
from roletrust_env.world.scenario import InRange


class Motion(NamedTuple):
    """Position and waypoint of each agent.

    Attributes:
        position: Position in metres, shape (N, 2, ...).
        goal: Waypoint that the agent heads for, in metres, shape (N, 2, ...).
    """

    position: Annotated[Array, Shape("N 2 ...")]
    goal: Annotated[Array, Shape("N 2 ...")]


def scatter(rule: InRange, position: Array, goal: Array) -> Motion:
    """Place the agents and their waypoints in the arena.

    Args:
        rule: Size of the arena.
        position: Uniform noise of shape (N, 2, ...).
        goal: Uniform noise of shape (N, 2, ...).
    """
    return Motion(position * rule.arena, goal * rule.arena)


def move(rule: InRange, motion: Motion, goal: Array) -> Motion:
    """Return the motion after one round: each agent moves towards its waypoint at constant speed.

    Args:
        rule: Size of the arena, and speed.
        motion: Motion before the round; it is not changed.
        goal: Uniform noise of shape (N, 2, ...): next waypoint of the agents that arrive, as a
            share of the arena.
    """
    xp = namespace(goal)
    way = motion.goal - motion.position
    distance = xp.sqrt((way**2).sum(axis=1))[:, None, ...]
    arrives = distance <= rule.speed
    stride = way * (rule.speed / xp.where(arrives, 1.0, distance))
    return Motion(
        xp.where(arrives, motion.goal, motion.position + stride),
        xp.where(arrives, goal * rule.arena, motion.goal),
    )
