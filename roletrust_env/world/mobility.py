"""Robots that move: random waypoints in a square arena."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.world.scenario import InRange


class Places(NamedTuple):
    """Where the agents are and where they are heading, in metres, shape (N, 2, ...) each."""

    position: Array
    goal: Array


def place(rule: InRange, position: Array, goal: Array) -> Places:
    """Scatter the agents over the arena; both arguments are uniform noise of shape (N, 2, ...)."""
    return Places(position * rule.arena, goal * rule.arena)


def move(rule: InRange, places: Places, goal: Array) -> Places:
    """One round of the random-waypoint walk: towards the goal at constant speed, then to a new one.

    Args:
        rule: the arena and the speed.
        places: where the agents are; left as they are.
        goal: uniform noise, shape (N, 2, ...): the next goal of those that arrive, as a share of the arena.
    """
    xp = namespace(goal)
    way = places.goal - places.position
    distance = xp.sqrt((way**2).sum(axis=1))[:, None, ...]
    arrives = distance <= rule.speed
    stride = way * (rule.speed / xp.where(arrives, 1.0, distance))
    return Places(
        xp.where(arrives, places.goal, places.position + stride),
        xp.where(arrives, goal * rule.arena, places.goal),
    )
