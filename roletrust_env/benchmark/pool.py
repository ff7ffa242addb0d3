"""Who plays the cells: processes of this machine. Results are the same wherever they are played."""

import os
from collections.abc import Generator, Sequence
from typing import Any, Protocol

from roletrust_env.benchmark.entrants import enter_packed
from roletrust_env.benchmark.processes import Answer, WorkerPool
from roletrust_env.benchmark.schema import CellResult, reason
from roletrust_env.benchmark.suite_types import AnyCell, AnySuite, suite_type

TRIES = 3
"""How often a cell is given to a worker that may die."""

_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""There is a worker for each core."""


Plays = Generator[tuple[Any, CellResult], None, None]
"""Cells, and what became of each."""


class Pool(Protocol):
    """Plays cells."""

    def play(self, suite: AnySuite, cells: Sequence[Any]) -> Plays:
        """Play cells and give them back as they are done, those that failed with the reason.

        What is still played when the generator is closed is stopped.
        """
        ...


class LocalPool:
    """Processes of this machine.

    Args:
        workers: Number of processes; None is one for each core that this process may use.
        entrants: Trust models that are given as objects, see `roletrust_env.benchmark.entrants.pack`.
    """

    def __init__(self, workers: int | None = None, entrants: bytes = b"") -> None:
        self.workers = workers or cores()
        self._entrants = entrants

    def play(self, suite: AnySuite, cells: Sequence[Any]) -> Plays:
        """See `Pool.play`."""
        with players(self.workers) as crew:
            yield from played(crew, suite, cells, self._entrants)


def players(workers: int) -> WorkerPool[AnyCell]:
    """So many processes that play cells."""
    return WorkerPool(play_safely, workers, _ONE_THREAD)


def played(crew: WorkerPool[AnyCell], suite: AnySuite, cells: Sequence[Any], entrants: bytes = b"") -> Plays:
    """Let a pool play cells, each within the suite's limit. See `Pool.play`."""
    for cell, answer in crew.do({cell: (suite, cell, entrants) for cell in cells}, suite.limit_s, TRIES):
        yield cell, _done(answer, suite)


def _done(answer: Answer, suite: AnySuite) -> CellResult:
    """What came of a cell."""
    if answer.late:
        return CellResult(
            (), suite.limit_s, failed=f"given up after {suite.limit_s:g} seconds, the suite's limit for a cell"
        )
    if answer.died is not None:
        return gone(f"the last time with exit code {answer.died}")
    done: CellResult = answer.value
    return done


def gone(words: str) -> CellResult:
    """What is said of a cell whose worker died, over and over."""
    return CellResult((), 0.0, failed=f"its worker died {TRIES} times, {words}")


def play_safely(suite: AnySuite, cell: AnyCell, entrants: bytes = b"") -> CellResult:
    """Play a cell; whatever a trust model, an attacker or a learner raises becomes one line."""
    try:
        enter_packed(entrants)
        return suite_type(suite).play(suite, cell)
    except (Exception, SystemExit) as error:  # of classes that others wrote
        return CellResult((), 0.0, failed=reason(error))


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
