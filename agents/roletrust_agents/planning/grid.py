"""Exact control by dynamic programming on a grid, for deterministic tasks with one number and a last action as state.

The backward pass is Bellman's principle of optimality (Bellman, Dynamic Programming, 1957): with z the state, l the
last action and D decisions,

    V[D](z, l) = 0,    V[t](z, l) = max over a of  r[t](z, l, a) + V[t + 1](z', a),    z' = f[t](z, l, a)

Actions are kept to levels, so l needs no interpolation; V is interpolated linearly in z. The forward pass then plays
greedily by V with the exact f, on finer actions, and a gradient search polishes what it played. So the score is always
one that was reached, and never better than the optimum.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Protocol

import numpy as np
from scipy.ndimage import map_coordinates  # type: ignore[import-untyped]
from scipy.optimize import minimize  # type: ignore[import-untyped]

from roletrust_env.arrays import Array

FINER = 8
"""Actions that the forward pass tries for each level of the backward pass."""


class Task(Protocol):
    """A deterministic control task. States and actions lie in [0, 1]; the first decision counts as its own last."""

    @property
    def decisions(self) -> int:
        """Number of decisions, D."""
        ...

    @property
    def start(self) -> float:
        """The state before the first decision."""
        ...

    @property
    def constant(self) -> float:
        """The part of the total score that no decision changes."""
        ...

    def step(self, t: int, state: Array, last: Array, action: Array) -> tuple[Array, Array]:
        """Reward and next state of decision t. The arguments broadcast; it is analytic but for kinks."""
        ...


@dataclass(frozen=True, eq=False)
class Solution:
    """The best play found, and how far off it may be.

    Attributes:
        total: the sum of rewards that `actions` reach by the exact dynamics: a lower bound of the optimum.
        actions: one for each decision, shape (D,).
        values: V[0] at the start, the optimum as the backward pass sees it, on grids of 1/4, 1/2 and all of the cells.
        seconds: that it took, by the clock on the wall.
    """

    total: float
    actions: Array
    values: tuple[float, ...]
    seconds: float

    @property
    def error(self) -> float:
        """How far the optimum may be from `total`, estimated; not a proof.

        The larger of two differences: between the last two grids, which by Richardson's extrapolation is what the last
        one is still off if its error falls in proportion to the cell, and less if it falls faster; and between the last
        grid and the total that was reached.
        """
        return max(abs(self.values[-1] - self.values[-2]), abs(self.values[-1] - self.total))


def solve(task: Task, *, levels: int, points: int) -> Solution:
    """Solve a task on a grid and on two coarser ones.

    Args:
        task: what is to be solved.
        levels: cells into which the range of the actions is cut, a multiple of 4.
        points: cells into which the range of the state is cut, a multiple of 4.

    Raises:
        ValueError: `levels` or `points` is not a positive multiple of 4.
    """
    for name, cells in (("levels", levels), ("points", points)):
        if not isinstance(cells, int) or cells < 4 or cells % 4:
            raise ValueError(f"{name} is {cells!r}; it must be a positive multiple of 4, as the grid is halved twice")
    began = perf_counter()
    values = []
    for coarser in (4, 2, 1):
        table = backward(task, levels // coarser, points // coarser)
        values.append(start_value(task, table))
    actions = polish(partial(total, task), forward(task, table))
    return Solution(float(total(task, actions)), actions, tuple(values), perf_counter() - began)


def backward(task: Task, levels: int, points: int) -> Array:
    """The table of V, shape (D + 1, levels + 1, points + 1): decision, last action, state."""
    actions, states = np.linspace(0, 1, levels + 1), np.linspace(0, 1, points + 1)
    table = np.zeros((task.decisions + 1, levels + 1, points + 1))
    for t in reversed(range(task.decisions)):
        table[t] = -np.inf
        # One action at a time: the arrays stay in the cache, and the memory is that of the table.
        for action, future in zip(actions, table[t + 1], strict=True):
            reward, after = task.step(t, states, actions[:, None], action)
            np.maximum(table[t], reward + np.interp(after, states, future), out=table[t])
    return table


def forward(task: Task, table: Array, finer: int = FINER) -> Array:
    """The actions of greedy play by V with the exact dynamics, shape (D,).

    Args:
        task: what is played.
        table: of V, from `backward`.
        finer: how many actions are tried for each level of the table, between which V is interpolated; 1 keeps to the
            levels.
    """
    levels, points = table.shape[1] - 1, table.shape[2] - 1
    options = np.linspace(0, 1, finer * levels + 1)
    state, last, played = np.asarray(task.start), options, np.zeros(task.decisions)
    for t in range(task.decisions):
        reward, after = task.step(t, state, last, options)
        future = map_coordinates(table[t + 1], (options * levels, after * points), order=1, mode="nearest")
        best = np.argmax(reward + future)
        state, last = after[best], options[best]
        played[t] = last
    return played


def start_value(task: Task, table: Array) -> float:
    """The optimum as the backward pass sees it: V before the first decision, which has no last action, and constant."""
    levels, points = table.shape[1] - 1, table.shape[2] - 1
    if not task.decisions:
        return task.constant
    options, states = np.linspace(0, 1, levels + 1), np.linspace(0, 1, points + 1)
    reward, after = task.step(0, np.asarray(task.start), options, options)
    future = [np.interp(z, states, row) for z, row in zip(after, table[1], strict=True)]
    return task.constant + float(np.max(reward + future))


def total(task: Task, actions: Array) -> Array:
    """The total score of sequences of actions, shape (D, ...), by the exact dynamics, shape (...)."""
    score, state = task.constant + 0 * actions.sum(axis=0), task.start
    for t, action in enumerate(actions):
        reward, state = task.step(t, state, actions[max(t - 1, 0)], action)
        score = score + reward
    return score


def polish(score: Callable[[Array], Array], actions: Array) -> Array:
    """Climb from some actions to the top of their hill, by L-BFGS-B (Byrd et al., 1995).

    The derivatives are complex steps (Squire and Trapp, 1998): exact, and all D of them are one batch.

    Args:
        score: of actions of shape (D, ...), the last axes being a batch; analytic but for kinks.
        actions: to begin with, (D,), in [0, 1].
    """
    tiny = 1e-30j * np.eye(len(actions))

    def descent(x: Array) -> tuple[float, Array]:
        found = score(x[:, None] + tiny)
        return -float(found[0].real), -found.imag / 1e-30

    if not len(actions):
        return actions
    # Where the task has a kink the search would never quite settle; the rest would be worth about 1e-7 of a score.
    stop = {"ftol": 1e-12, "gtol": 1e-10, "maxfun": 500}
    found = minimize(descent, actions, jac=True, method="L-BFGS-B", bounds=[(0, 1)] * len(actions), options=stop).x
    return max(actions, found, key=lambda x: float(score(x)))
