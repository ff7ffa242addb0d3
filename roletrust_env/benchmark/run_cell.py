"""Playing a cell: from its name in a suite to what was measured, the same wherever it is played."""

from collections.abc import Iterator
from time import perf_counter

from roletrust_env.benchmark.attackers import AttackBatch, as_curve, as_lists, scripted, searching, suited
from roletrust_env.benchmark.cells import HONEST, Cell, attacks, task_arguments
from roletrust_env.benchmark.schema import AttackResult, CellResult, reason
from roletrust_env.benchmark.suite import Suite
from roletrust_env.evaluation.attacked_games import TaskArguments, exact_task
from roletrust_env.evaluation.measurement import Measured, measure, measure_honest
from roletrust_env.evaluation.search import Budget, UnsuitableError
from roletrust_env.evaluation.specs import parse_kinds
from roletrust_env.game.attack_task import AttackTask


def play_cell(suite: Suite, cell: Cell) -> CellResult:
    """Play a cell.

    Args:
        suite: that it is of.
        cell: to be played.

    Raises:
        ValueError: a name of the suite is unknown, or a trust model or an attacker of another package fails.
    """
    began = perf_counter()
    arguments = task_arguments(suite, cell)
    task = exact_task(arguments)
    if cell.rung == HONEST:
        row = _row(HONEST, "everyone honest", 0, measure_honest(task, cell.seed, suite.games), 0)
        return CellResult((row,), perf_counter() - began, env_steps=2 * suite.games * task.game.scenario.max_cycles)
    rows: list[AttackResult] = []
    failed: list[str] = []
    steps = 0
    try:
        for found, words in _attacks(suite, cell, task, arguments):
            good, bad = _measured(suite, cell, task, found, words)
            rows, failed = rows + good, failed + bad
            steps += found.rounds + 2 * (len(found.names) + 1) * suite.games * task.game.scenario.max_cycles
    except UnsuitableError as error:
        return CellResult((), perf_counter() - began, unsuitable=str(error))
    return CellResult(tuple(rows), perf_counter() - began, failed="; ".join(failed), env_steps=steps)


def _attacks(suite: Suite, cell: Cell, task: AttackTask, arguments: TaskArguments) -> Iterator[tuple[AttackBatch, str]]:
    """The attacks of a cell, with what they are in words."""
    names = attacks(suite)
    kinds = dict(zip(names, parse_kinds(names, task.game.scenario), strict=True))
    kinds = suited(task, kinds, identities=suite.tracks[cell.track].reserve > 0)
    if cell.rung == "scripted":
        for found in scripted(task, kinds, 2 * suite.games):
            yield found, "at its defaults"
        return
    rung = searching(cell.rung, list(kinds.values()))
    attempt = rung.search(arguments, Budget(suite.budget), cell.seed)
    yield AttackBatch((cell.rung,), attempt.attacker, attempt.rounds), attempt.description


def _measured(
    suite: Suite, cell: Cell, task: AttackTask, found: AttackBatch, words: str
) -> tuple[list[AttackResult], list[str]]:
    """What some attacks came to, and what went wrong with those that failed; one that fails takes no other along.

    Raises:
        Exception: all fail; that of the first one.
    """
    try:
        scores = measure(task, found.attacker, cell.seed, (len(found.names), suite.games))
    except Exception as error:  # of a trust model or an attacker that others wrote
        if len(found.names) == 1:
            raise
        return _one_by_one(suite, cell, task, found, words, error)
    return [_row(name, words, found.rounds, scores, k) for k, name in enumerate(found.names)], []


def _row(name: str, words: str, rounds: int, scores: Measured, k: int) -> AttackResult:
    """The k-th of the attacks that were measured side by side, as plain data."""
    chosen, measured = (as_lists(half, k) for half in scores[:2])
    return AttackResult(name, words, rounds, chosen, measured, as_curve(scores.by_round, k))


def _one_by_one(
    suite: Suite, cell: Cell, task: AttackTask, found: AttackBatch, words: str, error: Exception
) -> tuple[list[AttackResult], list[str]]:
    """The same of each attack by itself, after some of them failed together."""
    rows, failed = [], []
    for one in found.apart():
        try:
            rows += _measured(suite, cell, task, one, words)[0]
        except Exception as its:
            failed.append(f"attack {one.names[0]}: {reason(its)}")
    if not rows:
        raise error
    return rows, failed
