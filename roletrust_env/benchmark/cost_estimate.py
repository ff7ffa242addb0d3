"""What a run would take, found by trying a little of it."""

from collections.abc import Sequence
from time import process_time
from typing import NamedTuple

from roletrust_env.benchmark.attackers import SEARCHING, searching
from roletrust_env.benchmark.cells import HONEST, Cell, attacks, place, task_arguments
from roletrust_env.benchmark.suite import Suite
from roletrust_env.evaluation.attacked_games import HELD_OUT, exact_task, judged_rollout, random_sources
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.search import Budget, UnsuitableError

_TRIED = 4
"""Rounds of a trial of a trust model."""
_BUDGET = 6_000
"""Rounds x games of a trial of a search, a learner or the planner, at the most."""


class CostEstimate(NamedTuple):
    """What some cells take.

    Attributes:
        cells: how many.
        env_steps: rounds x games.
        seconds: of one core.
    """

    cells: int
    env_steps: int
    seconds: float


def estimate_cost(suite: Suite, cells: Sequence[Cell]) -> dict[str, CostEstimate]:
    """What the cells of each trust model take, by its name: an upper bound of the rounds, a guess of the time.

    Each model is tried in each world; what a search, a learner or the planner takes beside what it plays, with the
    first model only.
    """
    speeds: dict[tuple[str, str, str], float] = {}
    beside: dict[tuple[str, str], float] = {}
    found: dict[str, CostEstimate] = {}
    for cell in cells:
        where, way = (cell.model, cell.scenario, cell.track), (cell.rung, cell.scenario)
        if where not in speeds:
            speeds[where] = _seconds_each(suite, cell)
        if way not in beside:
            beside[way] = _beside(suite, cell, speeds[where]) if cell.rung in SEARCHING else 0.0
        to_find, to_measure = rounds(suite, cell)
        seconds = speeds[where] * (to_find + to_measure) + beside[way] * to_find
        before = found.get(cell.model, CostEstimate(0, 0, 0.0))
        found[cell.model] = CostEstimate(
            before.cells + 1, before.env_steps + to_find + to_measure, before.seconds + seconds
        )
    return found


def rounds(suite: Suite, cell: Cell) -> tuple[int, int]:
    """Rounds x games of a cell at the most, to find attacks and to measure them: all of the suite fit."""
    each = 2 * suite.games * place(suite, cell).scenario.max_cycles
    if cell.rung == HONEST:
        return 0, each
    if cell.rung == "scripted":
        return 0, each * (len(attacks(suite)) + 1)
    return suite.budget, 2 * each


def _seconds_each(suite: Suite, cell: Cell) -> float:
    """Seconds of a round of a game in a batch, with everybody honest."""
    arguments = task_arguments(suite, cell)
    task = exact_task(
        {**arguments, "scenario": arguments["scenario"].change(max_cycles=_TRIED), "objective": "mislead"}
    )
    taken = []
    for _ in range(2):  # the first time, much is made ready
        began = process_time()
        for _ in judged_rollout(task, Scripted({}), (1, suite.games), *random_sources(task, 0, HELD_OUT)):
            pass
        taken.append(process_time() - began)
    return min(taken) / _TRIED / suite.games


def _beside(suite: Suite, cell: Cell, seconds_each: float) -> float:
    """Seconds that a rung takes for a round beside playing it."""
    began = process_time()
    try:
        attempt = searching(cell.rung).search(
            task_arguments(suite, cell), Budget(min(suite.budget, _BUDGET)), cell.seed
        )
    except UnsuitableError:
        return 0.0
    return max(0.0, (process_time() - began) / max(attempt.rounds, 1) - seconds_each)
