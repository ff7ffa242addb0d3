"""What a run would take, found by trying a little of it."""

from collections.abc import Sequence
from time import perf_counter
from typing import NamedTuple

from agents.ladder.players import Scripted
from agents.ladder.rungs import HELD_OUT, exact_task, play, sources
from experiments.benchmark.cells import HONEST, Cell, attacks, place
from experiments.benchmark.suite import Suite
from experiments.naming import parse_trust_model

_TRIED = 4
"""Rounds of a trial."""


class Foreseen(NamedTuple):
    """What some cells take.

    Attributes:
        cells: how many.
        env_steps: rounds x games.
        seconds: of one core.
    """

    cells: int
    env_steps: int
    seconds: float


def foresee(suite: Suite, cells: Sequence[Cell]) -> dict[str, Foreseen]:
    """What the cells of each trust model take, by its name: an upper bound of the rounds, a guess of the time."""
    speeds: dict[tuple[str, str, str], float] = {}
    found: dict[str, Foreseen] = {}
    for cell in cells:
        where = cell.model, cell.scenario, cell.track
        if where not in speeds:
            speeds[where] = _seconds_each(suite, cell)
        steps = env_steps(suite, cell)
        before = found.get(cell.model, Foreseen(0, 0, 0.0))
        found[cell.model] = Foreseen(before.cells + 1, before.env_steps + steps, before.seconds + steps * speeds[where])
    return found


def env_steps(suite: Suite, cell: Cell) -> int:
    """Rounds x games of a cell at the most: all attacks of the suite fit, and a search takes its whole budget."""
    each = suite.games * place(suite, cell).scenario.max_cycles
    if cell.rung == HONEST:
        return each
    if cell.rung == "scripted":
        return 2 * each * (len(attacks(suite)) + 1)
    return suite.budget + 4 * each


def _seconds_each(suite: Suite, cell: Cell) -> float:
    """Seconds of a round of a game in a batch, with everybody honest."""
    scenario, compromised = place(suite, cell)
    task = exact_task(
        {
            "scenario": scenario.change(max_cycles=max(_TRIED, 2)),
            "trust_model": parse_trust_model(cell.model, scenario),
            "compromised": compromised or ("sr_0",),
            "objective": "mislead",
        }
    )
    began = perf_counter()
    for _ in play(task, Scripted({}), (1, suite.games), *sources(task, 0, HELD_OUT)):
        pass
    return (perf_counter() - began) / _TRIED / suite.games
