"""Cost of a run, estimated from short trials."""

from collections.abc import Sequence
from time import process_time
from typing import Any, NamedTuple

from roletrust_env.benchmarking.cells import COMMON_GAMES, make_search, task_arguments
from roletrust_env.benchmarking.schema import SuiteSchema
from roletrust_env.benchmarking.suite import HONEST, WITHOUT_SEARCH, Cell, Suite, attacked_scenario
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import (
    HELD_OUT,
    exact_task,
    judged_rollout,
    random_sources,
)
from roletrust_env.evaluation.search import Budget, UnsuitableError
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.trust.model_checks import needs_watching

_TRIAL_ROUNDS = 4
"""Number of rounds in a trial of a trust model."""
_TRIAL_BATCH = 8
"""Number of attacks side by side in a trial of a trust model; scripts, known attacks and searches
play so, too."""
_TRIAL_BUDGETS = (6_000, 100_000)
"""Budgets of a trial of a search, a learner or the planner, in game rounds (rounds x games); the
larger one is tried if the smaller one does not suffice."""


class CostEstimate(NamedTuple):
    """Cost of several cells.

    Attributes:
        cells: Number of cells.
        env_steps: Number of game rounds, rounds x games.
        seconds: Time of one core in seconds.
    """

    cells: int
    env_steps: int
    seconds: float


def estimate_cost(suite: Suite, cells: Sequence[Cell]) -> dict[str, CostEstimate]:
    """Return the cost of the cells of each trust model: an upper bound of the rounds and an
    estimate of the time.

    The speed of each model is measured in each scenario and track. The overhead of a search, a
    learner or the planner is measured with the first model only.
    """
    seconds, costs = estimate_seconds(suite, cells), dict[str, CostEstimate]()
    for cell in cells:
        before = costs.get(cell.model, CostEstimate(0, 0, 0.0))
        rounds = sum(round_counts(suite, cell))
        costs[cell.model] = CostEstimate(
            before.cells + 1, before.env_steps + rounds, before.seconds + seconds[cell.key]
        )
    return costs


def estimate_seconds(suite: Suite, cells: Sequence[Cell]) -> dict[str, float]:
    """Return an estimate of the seconds of each cell on one core, by its key."""
    speeds: dict[tuple[str, str, str], float] = {}
    overheads: dict[tuple[str, str], float] = {}
    seconds: dict[str, float] = {}
    for cell in cells:
        where, searching = (cell.model, cell.scenario, cell.track), (cell.method, cell.scenario)
        if where not in speeds:
            speeds[where] = _seconds_each(suite, cell)
        if searching not in overheads:
            overheads[searching] = (
                0.0 if cell.method in WITHOUT_SEARCH else _overhead(suite, cell, speeds[where])
            )
        to_find, to_measure = round_counts(suite, cell)
        seconds[cell.key] = speeds[where] * (to_find + to_measure) + overheads[searching] * to_find
    return seconds


def round_counts(suite: Suite, cell: Cell) -> tuple[int, int]:
    """Return upper bounds of the game rounds (rounds x games) that find attacks, and of those that
    measure them.
    """
    rounds, more = (
        attacked_scenario(suite, cell).scenario.max_cycles,
        suite.tracks[cell.track].games or 0,
    )
    each = 2 * suite.games * rounds
    if cell.method == HONEST:
        return 0, each
    if cell.method == "scripted":
        return 0, each * (len(suite.attack_names) + 1) + 3 * more * rounds
    if cell.method == "known":
        return 0, each * (len(suite.known_in(cell[1:4])) + 1) + 3 * more * rounds
    common = COMMON_GAMES * suite.games * rounds if suite.seeds[1:] else 0
    return suite.budget_of(cell), 2 * each + common + 3 * more * rounds


def _seconds_each(suite: Suite, cell: Cell) -> float:
    """Return the seconds of a round of one game in a batch, while all agents are honest."""
    arguments = task_arguments(suite, cell)
    task = exact_task(
        {
            **arguments,
            "scenario": arguments["scenario"].change(max_cycles=_TRIAL_ROUNDS),
            "objective": "mislead",
        }
    )
    seconds = 0.0
    for batch in (1, _TRIAL_BATCH):  # the first pass includes one-time preparations
        began = process_time()
        for _ in judged_rollout(
            task, Scripted({}), (batch, suite.games), *random_sources(task, 0, HELD_OUT)
        ):
            pass
        seconds = (process_time() - began) / batch
    return seconds / _TRIAL_ROUNDS / suite.games


def _overhead(suite: Suite, cell: Cell, seconds_each: float) -> float:
    """Return the seconds that a method takes for each round in addition to playing it."""
    for budget in _TRIAL_BUDGETS:
        began = process_time()
        try:
            search = make_search(cell.method).search(
                task_arguments(suite, cell), Budget(min(suite.budget_of(cell), budget)), cell.seed
            )
        except UnsuitableError:
            continue
        return max(0.0, (process_time() - began) / max(search.rounds, 1) - seconds_each)
    return 0.0


_STANDS_IN = "role-trust"
"""Model whose trial stands in for that of a model of another package, which might hang outside a
process of its own."""


def cell_costs(suite: SuiteSchema, cells: Sequence[Any]) -> dict[str, float]:
    """Return the estimated cost of each cell by its key, in any unit, after short trials, which
    take some seconds.

    The cells of a run differ in cost by a factor of a thousand, so their number says little of the
    remaining time. All trials of a learner count alike, and so do all cells where a trial fails, as
    its cells will.
    """
    alike = dict.fromkeys((cell.key for cell in cells), 1.0)
    if not isinstance(suite, Suite):
        return alike
    scenario = next(iter(suite.scenarios.values())).scenario()
    foreign = {
        name
        for name in {cell.model for cell in cells}
        if needs_watching(parse_trust_model(name, scenario))
    }
    tried = [cell._replace(model=_STANDS_IN) if cell.model in foreign else cell for cell in cells]
    try:
        seconds = estimate_seconds(suite, tried)
    except Exception:  # attacks of other packages may raise anything
        return alike
    return {cell.key: seconds[trial.key] for cell, trial in zip(cells, tried, strict=True)}
