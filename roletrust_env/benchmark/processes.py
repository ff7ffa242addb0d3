"""Processes that work for this one, do one job after another, and may be killed or stopped at any moment.

Each has a pipe of its own, whose other end only it holds: its end, in the middle of a word too, is noticed at once, and
harms no other. A shared queue would be left locked, or with half a message in it.
"""

import os
import signal
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager, suppress
from math import inf
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from threading import Thread
from time import monotonic
from typing import Any, Generic, NamedTuple, Self, TypeVar

Key = TypeVar("Key", bound=Hashable)

_SPAWN = get_context("spawn")  # a fork of a process with threads, as torch has them, may hang
_LOOK_S = 0.2
"""Between looks at the clock."""
_STILLBORN = 6
"""So many processes in a row that end before their first job, and no further one is started."""


class Answer(NamedTuple):
    """What became of a job.

    Attributes:
        value: what it returned.
        late: whether it was stopped, since it took too long.
        died: exit code of the last process that died of it; None if it was done or late.
    """

    value: Any = None
    late: bool = False
    died: int | None = None


class _Job(NamedTuple, Generic[Key]):
    """A job; `attempt` counts from 1."""

    key: Key
    arguments: tuple[Any, ...]
    attempt: int


class _Worker(Generic[Key]):
    """A process.

    Attributes:
        link: to it; it sends something when it is ready and after each job.
        ready: whether it waits for a job or is at one.
        job: that it is at.
        until: when that has to be done, by the monotonic clock.
    """

    def __init__(
        self, work: Callable[..., Any], environment: Mapping[str, str], prepare: Callable[[], None] | None
    ) -> None:
        self.link, theirs = _SPAWN.Pipe()
        self.ready, self.until = False, inf
        self.job: _Job[Key] | None = None
        self._process = _SPAWN.Process(target=_serve, args=(work, prepare, theirs), daemon=True)
        with _environment(environment):
            self._process.start()
        theirs.close()

    def begin(self, job: _Job[Key], limit_s: float) -> None:
        """Give it a job; one that died meanwhile is noticed when it is listened to."""
        self.job, self.until = job, monotonic() + limit_s
        with suppress(OSError):
            self.link.send(job.arguments)

    def stop(self) -> int:
        """End it, and what it has started; its exit code."""
        if os.name == "posix":
            with suppress(ProcessLookupError):  # it has not come so far as to have a group
                os.killpg(self._process.pid or 0, signal.SIGKILL)
        self._process.kill()
        self._process.join()
        self.link.close()
        return self._process.exitcode or 0


class WorkerPool(Generic[Key]):
    """Some processes.

    Args:
        work: a function of a module, which does a job.
        number: of processes; they start with the first job.
        environment: variables that they have beside those of this process.
        prepare: a function of a module that each calls as it starts.
    """

    def __init__(
        self,
        work: Callable[..., Any],
        number: int,
        environment: Mapping[str, str],
        prepare: Callable[[], None] | None = None,
    ) -> None:
        self._number = number
        self._of_each = work, environment, prepare
        self._workers: list[_Worker[Key]] = []

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End all processes."""
        while self._workers:
            self._workers.pop().stop()

    def do(
        self,
        jobs: Mapping[Key, tuple[Any, ...]],
        limit_s: float,
        tries: int = 1,
        advance: Callable[[Key], None] = lambda key: None,
    ) -> Iterator[tuple[Key, Answer]]:
        """Do jobs, and tell of each when it is done.

        Args:
            jobs: arguments of each, which can be sent to another process.
            limit_s: seconds that a job may take, not counting what a process needs to start.
            tries: how often a job is begun whose process dies.
            advance: called with each key before its job begins.

        Raises:
            ChildProcessError: processes end before they can work.
        """
        todo = [_Job(key, arguments, 1) for key, arguments in reversed(tuple(jobs.items()))]
        stillborn = 0
        while todo or any(worker.job for worker in self._workers):
            while len(self._workers) < min(self._number, len(todo) + sum(w.job is not None for w in self._workers)):
                self._workers.append(_Worker(*self._of_each))
            heard = wait([worker.link for worker in self._workers], _LOOK_S)
            for worker in list(self._workers):
                job, late = worker.job, monotonic() > worker.until
                if worker.link in heard:
                    try:
                        word = worker.link.recv()
                    except (EOFError, OSError):
                        stillborn = 0 if worker.ready else stillborn + 1
                        died = self._dismiss(worker)
                        if job and job.attempt < tries:
                            todo.append(job._replace(attempt=job.attempt + 1))
                        elif job:
                            yield job.key, Answer(died=died)
                        continue
                    worker.ready, worker.job, worker.until, stillborn = True, None, inf, 0
                    if job:
                        yield job.key, Answer(word)
                elif job and late:
                    self._dismiss(worker)
                    yield job.key, Answer(late=True)
                    continue
                if todo and worker.ready and worker.job is None:
                    advance(todo[-1].key)
                    worker.begin(todo.pop(), limit_s)
            if stillborn >= _STILLBORN:
                raise ChildProcessError(
                    f"{stillborn} worker processes in a row ended before they could work; see above for what they said"
                )

    def _dismiss(self, worker: _Worker[Key]) -> int:
        self._workers.remove(worker)
        return worker.stop()


@contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Variables that processes have which are started meanwhile: libraries read theirs as they are loaded."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            os.environ.update({} if value is None else {name: value})


def _serve(work: Callable[..., Any], prepare: Callable[[], None] | None, link: Connection) -> None:
    """What a process does, until the link is closed."""
    if os.name == "posix":
        os.setsid()  # a group of its own, with all that it starts; an interrupt from the keyboard is not for it
    Thread(target=_follow, daemon=True).start()
    if prepare is not None:
        prepare()
    with suppress(EOFError, OSError):
        link.send(None)
        while True:
            link.send(work(*link.recv()))


def _follow() -> None:
    """End when the process ends that started this one, also if it is killed; a job that hangs would go on for ever."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
