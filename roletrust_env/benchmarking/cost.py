"""Cost of a run, estimated from a short trial of each trust model."""

from collections.abc import Sequence
from time import process_time

from roletrust_env.benchmarking.cells import find_attacks, pairs
from roletrust_env.benchmarking.learners.suite import LearnersSuite
from roletrust_env.benchmarking.play import CellPlay
from roletrust_env.benchmarking.search import FINALISTS
from roletrust_env.benchmarking.suite import Cell, Rule, Suite
from roletrust_env.evaluation.agreed import AgreedScripts

_SIDE_BY_SIDE = 8
"""Number of attacks in a trial."""


def game_rounds(suite: Suite, cell: Cell) -> int:
    """Return the number of game rounds that a cell plays at most, rounds x games."""
    selection, measured = (
        sum(world.max_cycles for world in suite.worlds.worlds(use))
        for use in ("selection", "measured")
    )
    play, tried = CellPlay(suite, cell), 0
    if cell.method == "search":
        attacks = suite.search.starts * (1 + FINALISTS)
        bases = pairs(suite, cell, play.task("selection", 0))
        further = suite.search.starts * suite.search.candidates * bool(bases)
        tried = suite.search.games * (len(bases) + further)
    else:
        attacks = len(list(find_attacks(play)))
    return selection * (attacks * suite.selection_games + tried) + measured * suite.games


def estimate_seconds(suite: Suite, cells: Sequence[Cell]) -> dict[str, float]:
    """Return an estimate of the seconds of each cell on one core, by its key.

    The speed of each trust model is measured in the first selection world with compromised agents,
    in some seconds for each model.
    """
    setting = next(name for name, setting in suite.settings.items() if setting.roles)
    speeds, rounds = dict[tuple[str, Rule], float](), dict[Cell, int]()
    seconds = {}
    for cell in cells:
        # The number of rounds depends neither on the model nor on the choice rule.
        who = (cell.model, cell.rule)
        where = cell._replace(model=suite.solo["common"], rule="common")
        if who not in speeds:
            speeds[who] = _seconds_each(suite, cell._replace(setting=setting, method="scripts"))
        if where not in rounds:
            rounds[where] = game_rounds(suite, where)
        seconds[cell.key] = speeds[who] * rounds[where]
    return seconds


def learner_rounds(suite: LearnersSuite) -> int:
    """Return the number of game rounds that each learner of a suite plays at most, rounds x
    games.
    """
    cycles: list[int] = [task.arguments()["scenario"].max_cycles for task in suite.tasks.values()]
    learned = len(cycles) * sum(suite.budgets)
    return len(suite.seeds) * (learned + len(suite.budgets) * suite.games * sum(cycles))


def _seconds_each(suite: Suite, cell: Cell) -> float:
    """Return the seconds of a game round in a batch."""
    one = suite.model_copy(update={"worlds": suite.worlds.model_copy(update={"selection": 1})})
    play, began = CellPlay(one, cell), process_time()
    play.measure("selection", [AgreedScripts()] * _SIDE_BY_SIDE)
    return (process_time() - began) / play.steps
