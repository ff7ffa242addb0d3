"""Execution of a cell. The result depends only on the suite and the cell, not on the machine or the order."""

from collections.abc import Callable, Iterator
from functools import cache
from time import perf_counter
from typing import NamedTuple

from roletrust_env.benchmarking.attackers import (
    AttackBatch,
    as_curve,
    as_lists,
    known_batches,
    make_search,
    playable_kinds,
    scripted_batches,
)
from roletrust_env.benchmarking.cells import Cell, attack_names, task_arguments
from roletrust_env.benchmarking.schema import AttackResult, CellResult, reason
from roletrust_env.benchmarking.suite import HONEST, WITHOUT_SEARCH, Suite
from roletrust_env.errors import suggest
from roletrust_env.evaluation.attack_space import AttackKind
from roletrust_env.evaluation.attacked_games import TaskArguments, exact_task
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import GameRecord, SplitScores, measure, measure_honest, watch_honest
from roletrust_env.evaluation.records import read_record, record_of
from roletrust_env.evaluation.search import Budget, UnsuitableError
from roletrust_env.evaluation.specs import parse_kinds
from roletrust_env.game.attack_task import AttackTask


def play_cell(suite: Suite, cell: Cell, record: str = "", *, isolated: bool = False) -> CellResult:
    """Play a cell.

    Args:
        suite: Suite of the cell.
        cell: Cell to play.
        record: Record of the attacker that plays in place of a search, see `AttackResult`. Empty searches.
        isolated: Give a trust model of another package a process of its own, see `IsolatedModel`.

    Raises:
        ValueError: A name in the suite is unknown, the record is not valid, or a trust model or an attacker of a
            plug-in fails.
    """
    began = perf_counter()
    arguments = task_arguments(suite, cell, isolated=isolated)
    task = exact_task(arguments)
    if cell.method == HONEST:
        nobody = AttackBatch((HONEST,), Scripted({}), 0, "everyone honest")
        row = _row(nobody, 0, measure_honest(task, cell.seed, suite.games))
        return CellResult((row,), perf_counter() - began, env_steps=2 * suite.games * task.game.scenario.max_cycles)
    rows: list[AttackResult] = []
    failed: list[str] = []
    steps = 2 * suite.games * task.game.scenario.max_cycles
    twin = cache(lambda: watch_honest(task, cell.seed, 2 * suite.games))  # the same for all attacks of the cell
    try:
        for batch in _attacks(suite, cell, task, arguments, record):
            try:
                good, errors = _measure_batch(suite, cell, task, batch, twin)
            except ValueError as error:
                if cell.method != "known":
                    raise
                good, errors = [], [f"attack {', '.join(batch.names)}: {reason(error)}"]
            rows, failed = rows + good, failed + errors
            steps += batch.rounds + 2 * len(batch.names) * suite.games * task.game.scenario.max_cycles
    except UnsuitableError as error:
        return CellResult((), perf_counter() - began, unsuitable=str(error))
    return CellResult(tuple(rows), perf_counter() - began, failed="; ".join(failed), env_steps=steps)


class FoundAttack(NamedTuple):
    """An attack of a cell, ready to play.

    Attributes:
        task: Task of the cell.
        batch: Attacks that play side by side. They share their random numbers, so one of them alone would play other
            games.
        row: Row of the attack among them.
    """

    task: AttackTask
    batch: AttackBatch
    row: int

    @property
    def rows(self) -> int:
        """Number of attacks that play side by side."""
        return len(self.batch.names)


def find_attack(suite: Suite, cell: Cell, attack: str, record: str = "") -> FoundAttack:
    """Return an attack of a cell. Without a record a search runs again, with the same seed and budget.

    Args:
        suite: Suite of the cell.
        cell: The cell.
        attack: Name of the attack in the results of the cell.
        record: Record of the attacker in these results.

    Raises:
        ValueError: The cell has no such attack, or see `play_cell`.
    """
    if cell.method == HONEST:
        raise ValueError(f"cell {cell.key} has no attack: everybody is honest there")
    arguments = task_arguments(suite, cell)
    task = exact_task(arguments)
    known: list[str] = []
    for batch in _attacks(suite, cell, task, arguments, record):
        if attack in batch.names:
            return FoundAttack(task, batch, batch.names.index(attack))
        known += batch.names
    raise ValueError(f"cell {cell.key} has no attack {attack!r}{suggest(attack, known)}")


def cell_kinds(suite: Suite, cell: Cell, task: AttackTask) -> dict[str, AttackKind]:
    """Return the kinds of scripted attacks of a suite that the compromised agents of a cell can play, by name.

    Args:
        suite: Suite of the cell.
        cell: The cell.
        task: Task of the cell.
    """
    names = attack_names(suite)
    kinds = dict(zip(names, parse_kinds(names, task.game.scenario), strict=True))
    return playable_kinds(task, kinds, identities=suite.tracks[cell.track].reserve > 0)


def _attacks(
    suite: Suite, cell: Cell, task: AttackTask, arguments: TaskArguments, record: str
) -> Iterator[AttackBatch]:
    """Yield the attacks of a cell in batches."""
    if record and cell.method not in WITHOUT_SEARCH:
        yield AttackBatch((cell.method,), read_record(record), 0, "as recorded", record)
        return
    kinds = cell_kinds(suite, cell, task)
    if cell.method == "scripted":
        yield from scripted_batches(task, kinds, 2 * suite.games)
        return
    known = suite.known_in(cell[1:4])
    if cell.method == "known":
        if not known:
            raise UnsuitableError("there is no known attack for this condition")
        yield from known_batches(task, known, 2 * suite.games)
        return
    method = make_search(cell.method, list(kinds.values()), [one.record for one in known])
    search = method.search(arguments, Budget(suite.budget_of(cell.method, cell.scenario)), cell.seed)
    found = record_of(search.attacker)
    yield AttackBatch((cell.method,), search.attacker, search.rounds, search.description, found, search.progress)


def _measure_batch(
    suite: Suite, cell: Cell, task: AttackTask, batch: AttackBatch, twin: Callable[[], GameRecord]
) -> tuple[list[AttackResult], list[str]]:
    """Return the results of a batch of attacks, and the error messages of the attacks that failed.

    An attack that fails does not affect the others.

    Raises:
        Exception: All attacks fail.
    """
    try:
        scores = measure(task, batch.attacker, cell.seed, (len(batch.names), suite.games), twin())
    except Exception as error:  # plug-in code may raise anything
        if len(batch.names) == 1:
            raise
        return _measure_singly(suite, cell, task, batch, twin, error)
    return [_row(batch, k, scores) for k in range(len(batch.names))], []


def _row(batch: AttackBatch, k: int, scores: SplitScores) -> AttackResult:
    """Return the scores of the k-th attack of a batch as plain data."""
    chosen, measured = (as_lists(half, k) for half in scores[:2])
    return AttackResult(
        *(batch.names[k], batch.words, batch.rounds, chosen, measured, as_curve(scores.by_round, k)),
        *(batch.record, batch.progress),
    )


def _measure_singly(
    suite: Suite, cell: Cell, task: AttackTask, batch: AttackBatch, twin: Callable[[], GameRecord], error: Exception
) -> tuple[list[AttackResult], list[str]]:
    """Measure each attack of a failed batch by itself. Raise `error` if all fail."""
    rows, failed = [], []
    for single in batch.split():
        try:
            rows += _measure_batch(suite, cell, task, single, twin)[0]
        except Exception as own_error:
            failed.append(f"attack {single.names[0]}: {reason(own_error)}")
    if not rows:
        raise error
    return rows, failed
