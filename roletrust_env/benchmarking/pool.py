"""Pools that play cells. The result of a cell does not depend on the pool."""

import os
from collections.abc import Generator, Mapping, Sequence
from typing import Any, Protocol

from roletrust_env.benchmarking.entrants import register_packed
from roletrust_env.benchmarking.processes import JobResult, WorkerPool
from roletrust_env.benchmarking.schema import CellResult, reason
from roletrust_env.benchmarking.suite_types import AnyCell, AnySuite, suite_type

TRIES = 3
"""Maximum number of attempts to play a cell whose worker process dies."""

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of a worker: one thread, since there is a worker for each core."""

PlayedCells = Generator[tuple[Any, CellResult], None, None]
"""Cells with their results."""


class Pool(Protocol):
    """Executor of cells."""

    def play(self, suite: AnySuite, cells: Sequence[Any]) -> PlayedCells:
        """Play cells and yield each with its result when it is finished.

        A failed cell has the reason in its result. Closing the generator stops the cells that are still being played.

        Args:
            suite: Suite of the cells.
            cells: Cells to play.
        """
        ...


class LocalPool:
    """Worker processes of this machine.

    Args:
        workers: Number of processes. None means one for each core that this process may use.
        entrants: Packed trust model objects, see `roletrust_env.benchmarking.entrants.pack`.
        records: Records of the attackers that play in place of a search, by cell, see `AttackResult`.
        isolated: Give trust models of other packages processes of their own, apart from the games.
    """

    def __init__(
        self,
        workers: int | None = None,
        entrants: bytes = b"",
        records: Mapping[AnyCell, str] | None = None,
        *,
        isolated: bool = False,
    ) -> None:
        self.workers = workers or cores()
        self._entrants = entrants
        self._records = records or {}
        self._isolated = isolated

    def play(self, suite: AnySuite, cells: Sequence[Any]) -> PlayedCells:
        """See `Pool.play`."""
        with cell_workers(self.workers) as workers:
            yield from play_on(workers, suite, cells, self._entrants, self._records, isolated=self._isolated)


def cell_workers(workers: int) -> WorkerPool[AnyCell]:
    """Return a pool of processes that play cells."""
    return WorkerPool(play_safely, workers, ONE_THREAD)


def play_on(
    workers: WorkerPool[AnyCell],
    suite: AnySuite,
    cells: Sequence[Any],
    entrants: bytes = b"",
    records: Mapping[AnyCell, str] | None = None,
    *,
    isolated: bool = False,
) -> PlayedCells:
    """Play cells on worker processes, each within the time limit of the suite. See `Pool.play`.

    Args:
        workers: Worker processes.
        suite: Suite of the cells.
        cells: Cells to play.
        entrants: Packed trust model objects, see `roletrust_env.benchmarking.entrants.pack`.
        records: Records of the attackers that play in place of a search, by cell.
        isolated: Give trust models of other packages processes of their own, apart from the games.
    """
    jobs = {cell: (suite, cell, entrants, (records or {}).get(cell, ""), isolated) for cell in cells}
    for cell, job_result in workers.run(jobs, suite.limit_s, TRIES):
        yield cell, _cell_result(job_result, suite)


def _cell_result(job_result: JobResult, suite: AnySuite) -> CellResult:
    if job_result.timed_out:
        return CellResult(
            (), suite.limit_s, failed=f"given up after {suite.limit_s:g} seconds, the suite's limit for a cell"
        )
    if job_result.exit_code is not None:
        return worker_death(f"the last time with exit code {job_result.exit_code}")
    result: CellResult = job_result.value
    return result


def worker_death(detail: str) -> CellResult:
    """Return the result of a cell whose worker process died in every attempt."""
    return CellResult((), 0.0, failed=f"its worker died {TRIES} times, {detail}")


def play_safely(
    suite: AnySuite, cell: AnyCell, entrants: bytes = b"", record: str = "", isolated: bool = False
) -> CellResult:
    """Play a cell. An exception of a trust model, an attacker or a learner becomes a failed result."""
    try:
        register_packed(entrants)
        play = suite_type(suite).play
        options = {"record": record, "isolated": isolated}
        return play(suite, cell, **{name: option for name, option in options.items() if option})
    except (Exception, SystemExit) as error:  # plug-in code may raise anything
        return CellResult((), 0.0, failed=reason(error))


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
