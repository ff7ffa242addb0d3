"""Who plays the cells: processes of this machine. Results are the same wherever they are played."""

import os
from collections.abc import Generator, Sequence
from typing import Any, Protocol

from experiments.benchmark.kinds import AnyCell, AnySuite, kind_of
from experiments.benchmark.terms import Done, reason
from experiments.processes import Answer, Crew

TRIES = 3
"""How often a cell is given to a worker that may die."""

_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""There is a worker for each core."""


Plays = Generator[tuple[Any, Done], None, None]
"""Cells, and what became of each."""


class Pool(Protocol):
    """Plays cells."""

    def play(self, suite: AnySuite, cells: Sequence[Any]) -> Plays:
        """Play cells and give them back as they are done, those that failed with the reason.

        What is still played when the generator is closed is stopped.
        """
        ...


class Here:
    """Processes of this machine.

    Args:
        workers: how many; by default one for each core that this process may use.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or cores()

    def play(self, suite: AnySuite, cells: Sequence[Any]) -> Plays:
        """See `Pool.play`."""
        with players(self.workers) as crew:
            yield from played(crew, suite, cells)


def players(workers: int) -> Crew[AnyCell]:
    """So many processes that play cells."""
    return Crew(play_safely, workers, _ONE_THREAD)


def played(crew: Crew[AnyCell], suite: AnySuite, cells: Sequence[Any]) -> Plays:
    """Have cells played, each within the suite's limit. See `Pool.play`."""
    for cell, answer in crew.do({cell: (suite, cell) for cell in cells}, suite.limit_s, TRIES):
        yield cell, _done(answer, suite)


def _done(answer: Answer, suite: AnySuite) -> Done:
    """What came of a cell."""
    if answer.late:
        return Done((), suite.limit_s, failed=f"given up after {suite.limit_s:g} seconds, the suite's limit for a cell")
    if answer.died is not None:
        return gone(f"the last time with exit code {answer.died}")
    done: Done = answer.value
    return done


def gone(words: str) -> Done:
    """What is said of a cell whose worker died, over and over."""
    return Done((), 0.0, failed=f"its worker died {TRIES} times, {words}")


def play_safely(suite: AnySuite, cell: AnyCell) -> Done:
    """Play a cell; whatever a trust model, an attacker or a learner raises becomes one line."""
    try:
        return kind_of(suite).play(suite, cell)
    except (Exception, SystemExit) as error:  # of classes that others wrote
        return Done((), 0.0, failed=reason(error))


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
