"""Worker processes that play cells, one after another, and that may be killed or stopped at any
moment.

Each worker has its own pipe and is the only holder of its other end. So the death of a worker is
noticed at once, even in the middle of a message, and does not affect other workers. A shared queue
could stay locked or hold half a message. The result of a cell does not depend on the pool.
"""

import os
import signal
import sys
from collections.abc import Callable, Generator, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from math import inf
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from threading import Thread
from time import monotonic
from typing import Any, Generic, NamedTuple, Protocol, Self, TypeVar

from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.entrants import register_packed
from roletrust_env.benchmarking.learners.suite import play_trial
from roletrust_env.benchmarking.schema import AnyCell, CellResult, SuiteSchema, reason
from roletrust_env.interrupts import without_interrupts

Key = TypeVar("Key", bound=Hashable)

_SPAWN = get_context("spawn")  # a forked process may hang if torch has started threads
_POLL_S = 0.2
"""Interval between checks of the time limits in seconds."""
_MAX_FAILED_STARTS = 6
"""Maximum number of consecutive processes that end before their first job."""


class JobResult(NamedTuple):
    """Result of a job.

    Attributes:
        value: Return value of the job.
        timed_out: Whether the job was stopped at its time limit.
        exit_code: Exit code of the last process that died during the job. None if the job returned
            or timed out.
    """

    value: Any = None
    timed_out: bool = False
    exit_code: int | None = None


class _Job(NamedTuple, Generic[Key]):
    """Job with the number of its attempt, which counts from 1."""

    key: Key
    arguments: tuple[Any, ...]
    attempt: int


class _Worker(Generic[Key]):
    """Worker process.

    Attributes:
        link: Connection to the process. The process sends a message when it is ready and after each
            job.
        ready: Whether the process has finished its start.
        job: Current job. None if the process is idle.
        deadline: Deadline of the current job on the monotonic clock.
    """

    def __init__(self, work: Callable[..., Any], environment: Mapping[str, str]) -> None:
        self.link, other_end = _SPAWN.Pipe()
        self.ready, self.deadline = False, inf
        self.job: _Job[Key] | None = None
        self._process = _SPAWN.Process(target=_serve, args=(work, other_end), daemon=True)
        with _environment(environment), _apart_from_main(), without_interrupts():
            self._process.start()
        other_end.close()

    def begin(self, job: _Job[Key], limit_s: float) -> None:
        """Send a job to the process. A process that has died is noticed at the next read."""
        self.job, self.deadline = job, monotonic() + limit_s
        with suppress(OSError):
            self.link.send(job.arguments)

    def stop(self) -> int:
        """Kill the process with its children, and return its exit code."""
        if os.name == "posix":
            with suppress(ProcessLookupError):  # it does not have a process group yet
                os.killpg(self._process.pid or 0, signal.SIGKILL)
        self._process.kill()
        self._process.join()
        self.link.close()
        return self._process.exitcode or 0


class WorkerPool(Generic[Key]):
    """Pool of worker processes.

    Args:
        work: Module-level function that does a job.
        number: Number of processes. They start with the first job.
        environment: Environment variables of the processes besides those of this process.
    """

    def __init__(
        self, work: Callable[..., Any], number: int, environment: Mapping[str, str]
    ) -> None:
        self._number = number
        self._worker_arguments = work, environment
        self._workers: list[_Worker[Key]] = []

    def __enter__(self) -> Self:
        """Return the pool."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop all processes."""
        self.close()

    def close(self) -> None:
        """Stop all processes. The next job starts new ones."""
        while self._workers:
            self._workers.pop().stop()

    def run(
        self, jobs: Mapping[Key, tuple[Any, ...]], limit_s: float, tries: int = 1
    ) -> Iterator[tuple[Key, JobResult]]:
        """Run jobs, and yield the result of each when it is finished.

        Args:
            jobs: Arguments of each job, by key. They must be picklable.
            limit_s: Time limit of a job in seconds, without the start of a process.
            tries: Maximum number of attempts for a job whose process dies.

        Raises:
            ChildProcessError: Processes end before they can work.
        """
        pending = [_Job(key, arguments, 1) for key, arguments in reversed(tuple(jobs.items()))]
        failed_starts = 0
        while pending or any(worker.job for worker in self._workers):
            while len(self._workers) < min(
                self._number, len(pending) + sum(w.job is not None for w in self._workers)
            ):
                self._workers.append(_Worker(*self._worker_arguments))
            readable = wait([worker.link for worker in self._workers], _POLL_S)
            for worker in list(self._workers):
                job, timed_out = worker.job, monotonic() > worker.deadline
                if worker.link in readable:
                    try:
                        value = worker.link.recv()
                    except (EOFError, OSError):
                        failed_starts = 0 if worker.ready else failed_starts + 1
                        exit_code = self._stop(worker)
                        if job and job.attempt < tries:
                            pending.append(job._replace(attempt=job.attempt + 1))
                        elif job:
                            yield job.key, JobResult(exit_code=exit_code)
                        continue
                    worker.ready, worker.job, worker.deadline, failed_starts = True, None, inf, 0
                    if job:
                        yield job.key, JobResult(value)
                elif job and timed_out:
                    self._stop(worker)
                    yield job.key, JobResult(timed_out=True)
                    continue
                if pending and worker.ready and worker.job is None:
                    worker.begin(pending.pop(), limit_s)
            if failed_starts >= _MAX_FAILED_STARTS:
                raise ChildProcessError(
                    f"{failed_starts} worker processes in a row ended before they could work; see "
                    "their errors above"
                )

    def _stop(self, worker: _Worker[Key]) -> int:
        self._workers.remove(worker)
        return worker.stop()


@contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables for processes that start in this context. Libraries read them when
    they are loaded.
    """
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            os.environ.update({} if value is None else {name: value})


@contextmanager
def _apart_from_main() -> Iterator[None]:
    """Let a process start without running the main script again. Models from there travel by value,
    so a script needs no guard, and a notebook or a program from standard input works, too.
    """
    main = vars(sys.modules["__main__"])
    known: dict[str, Any] = {
        name: main.pop(name) for name in ("__file__", "__spec__") if name in main
    }
    main["__spec__"] = None
    try:
        yield
    finally:
        main.update(known)


def _serve(work: Callable[..., Any], link: Connection) -> None:
    """Run the main loop of a worker process. It ends when the link is closed."""
    if os.name == "posix":
        os.setsid()  # own process group with its children; keyboard interrupts do not reach it
    Thread(target=_exit_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):
        link.send(None)
        while True:
            link.send(work(*link.recv()))


def _exit_with_parent() -> None:
    """Exit when the parent process ends, even if it is killed. Otherwise a job that hangs would run
    for ever.
    """
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


TRIES = 3
"""Maximum number of attempts to play a cell whose worker process dies."""

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of a worker: one thread, since there is a worker for each core."""

PlayedCells = Generator[tuple[Any, CellResult], None, None]
"""Cells with their results."""


class Pool(Protocol):
    """Executor of cells."""

    def play(self, suite: SuiteSchema, cells: Sequence[Any]) -> PlayedCells:
        """Play cells and yield each with its result when it is finished.

        A failed cell has the reason in its result. Closing the generator stops the cells that are
        still being played.
        """


class LocalPool:
    """Worker processes of this machine.

    Args:
        workers: Number of processes. None means one for each core that this process may use.
        entrants: Packed trust model objects, see `roletrust_env.benchmarking.entrants.pack`.
        records: Records of attackers by name that play in place of a search, by cell, see
            `play_cell`.
        isolated: Give trust models of other packages processes of their own, apart from the games.
        keep: Keep the processes for further cells, as long as this process runs.
    """

    def __init__(
        self,
        workers: int | None = None,
        entrants: bytes = b"",
        records: Mapping[AnyCell, Mapping[str, str]] | None = None,
        *,
        isolated: bool = False,
        keep: bool = False,
    ) -> None:
        self.workers = workers or cores()
        self._processes: WorkerPool[AnyCell] = WorkerPool(play_safely, self.workers, ONE_THREAD)
        self._entrants, self._records = entrants, records or {}
        self._isolated, self._keep = isolated, keep

    def play(self, suite: SuiteSchema, cells: Sequence[Any]) -> PlayedCells:
        """See `Pool.play`. Each cell has the time limit of the suite."""
        jobs = {
            cell: (suite, cell, self._entrants, self._records.get(cell), self._isolated)
            for cell in cells
        }
        try:
            for cell, job_result in self._processes.run(jobs, suite.limit_s, TRIES):
                yield cell, _cell_result(job_result, suite)
        finally:
            if not self._keep:
                self._processes.close()


def _cell_result(job_result: JobResult, suite: SuiteSchema) -> CellResult:
    if job_result.timed_out:
        return CellResult(
            (),
            suite.limit_s,
            failed=f"given up after {suite.limit_s:g} seconds, the suite's limit for a cell",
        )
    if job_result.exit_code is not None:
        return worker_death(f"the last time with exit code {job_result.exit_code}")
    result: CellResult = job_result.value
    return result


def worker_death(detail: str) -> CellResult:
    """Return the result of a cell whose worker process died in every attempt."""
    return CellResult((), 0.0, failed=f"its worker died {TRIES} times, {detail}")


_PLAY: dict[str, Callable[..., CellResult]] = {
    "closed-loop": play_cell,
    "learners": play_trial,
}
"""Functions that play a cell, by the kind of its suite."""


def play_safely(
    suite: SuiteSchema,
    cell: AnyCell,
    entrants: bytes = b"",
    records: Mapping[str, str] | None = None,
    isolated: bool = False,
) -> CellResult:
    """Play a cell. An exception of a trust model, an attacker or a learner becomes a failed
    result.
    """
    try:
        register_packed(entrants)
        play = _PLAY[suite.kind]
        options = {"records": records, "isolated": isolated}
        return play(suite, cell, **{name: option for name, option in options.items() if option})
    except (Exception, SystemExit) as error:  # plug-in code may raise anything
        return CellResult((), 0.0, failed=reason(error))


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
