"""Dynamic programming on a grid, for deterministic control tasks whose state is a number and the
last action.

The backward pass is Bellman's principle of optimality (Bellman, Dynamic Programming, 1957). With
the state z, the last action l and D decisions,

    V[D](z, l) = 0,    V[t](z, l) = max over a of  r[t](z, l, a) + V[t + 1](z', a),
            z' = f[t](z, l, a)

Actions are restricted to levels, so l needs no interpolation; V is interpolated linearly in z. The
forward pass then plays greedily by V with the exact f on finer actions, and a gradient search
improves these actions. So the score is that of a real sequence of actions, and never above the
optimum.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from scipy.ndimage import map_coordinates  # type: ignore[import-untyped]
from scipy.optimize import minimize  # type: ignore[import-untyped]

from roletrust_env.arrays import Array
from roletrust_env.parameters import whole_number

FINER = 8
"""Number of actions that the forward pass tries for each level of the backward pass."""


class GridTask(Protocol):
    """Deterministic control task. States and actions lie in [0, 1]. The first action is its own
    last action.
    """

    @property
    def rounds(self) -> int:
        """Number of rounds over which the rewards are averaged."""

    @property
    def decisions(self) -> int:
        """Number of decisions, D."""

    @property
    def start(self) -> float:
        """State before the first decision."""

    @property
    def constant(self) -> float:
        """Part of the total score that does not depend on the decisions."""

    def step(self, t: int, state: Array, last: Array, action: Array) -> tuple[Array, Array]:
        """Return the reward and the next state of decision t. The arguments are broadcast.

        The functions are analytic except at kinks.
        """


@dataclass(frozen=True, eq=False)
class Optimum:
    """Best actions in a game, up to the error of a grid.

    Attributes:
        score: Mean reward per round of `actions` under the exact dynamics, a lower bound of the
            optimum.
        error: Estimate of the distance between the score and the optimum; it is not a proven bound.
            It is the larger of two differences: between the values on the last two grids, and
            between the value on the last grid and the score. By Richardson's extrapolation, the
            first one is the error of the last grid if errors are proportional to the cell size, and
            larger than the error if they fall faster.
        values: Optimum per round according to the backward pass, V[0] at the start, on grids with
            1/4, 1/2 and all of the cells. It can be above or below the true optimum.
        actions: Actions, one for each decision, shape (D,).
    """

    score: float
    error: float
    values: tuple[float, ...]
    actions: Array


def solve(task: GridTask, cells: int) -> Optimum:
    """Solve a task on a grid and on two coarser ones.

    Args:
        task: Task to solve.
        cells: Number of grid cells of the actions, and of the state, a multiple of 4.

    Raises:
        ValueError: `cells` is not a positive multiple of 4.
    """
    if whole_number("cells", cells, 4) % 4:
        raise ValueError(
            f"cells is {cells!r}; it must be a positive multiple of 4, because the grid is halved "
            "twice"
        )
    values = []
    for coarser in (4, 2, 1):
        table = backward(task, cells // coarser, cells // coarser)
        values.append(start_value(task, table))
    actions = polish(partial(total, task), forward(task, table))
    score = float(total(task, actions))
    error = max(abs(values[-1] - values[-2]), abs(values[-1] - score))
    per_round = tuple(value / task.rounds for value in values)
    return Optimum(score / task.rounds, error / task.rounds, per_round, actions)


def backward(task: GridTask, levels: int, points: int) -> Array:
    """Return the table of V by decision, last action and state, shape (D + 1, levels + 1, points +
    1).
    """
    actions, states = np.linspace(0, 1, levels + 1), np.linspace(0, 1, points + 1)
    table = np.zeros((task.decisions + 1, levels + 1, points + 1))
    for t in reversed(range(task.decisions)):
        table[t] = -np.inf
        # With one action at a time, the arrays fit into the cache, and only the table takes memory.
        for action, future in zip(actions, table[t + 1], strict=True):
            reward, after = task.step(t, states, actions[:, None], action)
            np.maximum(table[t], reward + np.interp(after, states, future), out=table[t])
    return table


def forward(task: GridTask, table: Array, finer: int = FINER) -> Array:
    """Return the actions of greedy play by V with the exact dynamics, shape (D,).

    Args:
        task: Task to play.
        table: Table of V, from `backward`.
        finer: Number of actions to try for each level of the table, between which V is
            interpolated. With 1, only the levels are tried.
    """
    levels, points = table.shape[1] - 1, table.shape[2] - 1
    options = np.linspace(0, 1, finer * levels + 1)
    state, last, played = np.asarray(task.start), options, np.zeros(task.decisions)
    for t in range(task.decisions):
        reward, after = task.step(t, state, last, options)
        future = map_coordinates(
            table[t + 1], (options * levels, after * points), order=1, mode="nearest"
        )
        best = np.argmax(reward + future)
        state, last = after[best], options[best]
        played[t] = last
    return played


def start_value(task: GridTask, table: Array) -> float:
    """Return the optimum according to the backward pass: V before the first decision, plus the
    constant.
    """
    levels, points = table.shape[1] - 1, table.shape[2] - 1
    if not task.decisions:
        return task.constant
    options, states = np.linspace(0, 1, levels + 1), np.linspace(0, 1, points + 1)
    reward, after = task.step(0, np.asarray(task.start), options, options)
    future = [np.interp(z, states, row) for z, row in zip(after, table[1], strict=True)]
    return task.constant + float(np.max(reward + future))


def total(task: GridTask, actions: Array) -> Array:
    """Return the total scores, shape (...), of sequences of actions, shape (D, ...), under the
    exact dynamics.
    """
    score, state = task.constant + 0 * actions.sum(axis=0), task.start
    for t, action in enumerate(actions):
        reward, state = task.step(t, state, actions[max(t - 1, 0)], action)
        score = score + reward
    return score


def polish(score: Callable[[Array], Array], actions: Array) -> Array:
    """Return a local maximum of a score near some actions, by L-BFGS-B (Byrd et al., 1995).

    The derivatives are computed by complex steps (Squire and Trapp, 1998). They are exact, and all
    D of them are one batch.

    Args:
        score: Score of actions of shape (D, ...), with the batch in the last axes; analytic except
            at kinks.
        actions: Actions to start from, shape (D,), in [0, 1].
    """
    tiny = 1e-30j * np.eye(len(actions))

    def descent(x: Array) -> tuple[float, Array]:
        value = score(x[:, None] + tiny)
        return -float(value[0].real), -value.imag / 1e-30

    if not len(actions):
        return actions
    # At a kink the search would never converge; stopping early costs about 1e-7 of a score.
    stop = {"ftol": 1e-12, "gtol": 1e-10, "maxfun": 500}
    best = minimize(
        descent, actions, jac=True, method="L-BFGS-B", bounds=[(0, 1)] * len(actions), options=stop
    ).x
    return max(actions, best, key=lambda x: float(score(x)))
