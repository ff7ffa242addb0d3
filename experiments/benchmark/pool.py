"""Who plays the cells: processes of this machine. Results are the same wherever they are played."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from multiprocessing import get_context
from typing import Protocol

from pebble import ProcessExpired, ProcessPool

from experiments.benchmark.cells import Cell
from experiments.benchmark.suite import Suite
from experiments.benchmark.work import Done, play_cell

_TRIES = 3
"""How often a cell is given to a worker that may die."""


class Pool(Protocol):
    """Plays cells."""

    def play(self, suite: Suite, cells: Sequence[Cell]) -> Iterator[tuple[Cell, Done]]:
        """Play cells and give them back as they are done, those that failed with the reason."""
        ...


class Here:
    """Processes of this machine.

    Args:
        workers: how many; by default one for each core that this process may use.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or cores()

    def play(self, suite: Suite, cells: Sequence[Cell]) -> Iterator[tuple[Cell, Done]]:
        """See `Pool.play`."""
        context = get_context("spawn")  # a fork of a process with threads, as torch has them, may hang
        with ProcessPool(min(self.workers, max(1, len(cells))), initializer=one_thread, context=context) as pool:
            running: dict[Future[Done], tuple[Cell, int]] = {}
            waiting = [(cell, 1) for cell in reversed(cells)]
            try:
                while running or waiting:
                    while waiting and len(running) < 2 * self.workers:
                        cell, attempt = waiting.pop()
                        job = pool.schedule(play_safely, args=(suite, cell), timeout=suite.limit_s)
                        running[job] = cell, attempt
                    for ended in wait(running, return_when=FIRST_COMPLETED).done:
                        cell, attempt = running.pop(ended)
                        done = _result(ended, suite, attempt)
                        if done is None:
                            waiting.append((cell, attempt + 1))
                        else:
                            yield cell, done
            finally:
                pool.stop()  # type: ignore[no-untyped-call]


def _result(job: Future[Done], suite: Suite, attempt: int) -> Done | None:
    """What came of a cell; None if its worker died and another one should try."""
    try:
        return job.result()
    except TimeoutError:
        return Done((), suite.limit_s, failed=late(suite))
    except ProcessExpired as error:
        if attempt < _TRIES:
            return None
        return Done((), 0.0, failed=f"its worker died {_TRIES} times, the last time with exit code {error.exitcode}")


def late(suite: Suite) -> str:
    """What is said of a cell that took too long."""
    return f"given up after {suite.limit_s:g} seconds, the suite's limit for a cell"


def play_safely(suite: Suite, cell: Cell, play: Callable[[Suite, Cell], Done] = play_cell) -> Done:
    """Play a cell; whatever a trust model or an attacker raises becomes one line."""
    try:
        return play(suite, cell)
    except Exception as error:  # of classes that others wrote
        line = " ".join(str(error).split()) or "without a word"
        return Done((), 0.0, failed=line if isinstance(error, ValueError) else f"{type(error).__name__}: {line}")


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def one_thread() -> None:
    """Let libraries use one thread: there is a worker for each core."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
