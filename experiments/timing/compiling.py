"""Compiling ahead of the timing: in processes of their own, which can be stopped, into torch's cache on disk.

What one process has compiled, others find in the cache: the one that times it, and those of the next run, so that a run
that was broken off goes on where it was. The cache is where torch keeps it, see its TORCHINDUCTOR_CACHE_DIR.
"""

import os
import pickle
import signal
from collections.abc import Callable, Mapping
from contextlib import suppress
from math import inf
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from time import monotonic
from typing import Any, Generic, TypeVar

from experiments.results.machine import in_time
from experiments.timing.threads import torch_threads

Key = TypeVar("Key")

_SPAWN = get_context("spawn")  # torch does not take well to forks
_WORKERS = 2
_BROKEN = "the process that compiled it broke down"
_LOOK_S = 0.2
"""Between looks at the clock."""


class _Worker(Generic[Key]):
    """A process that does one job after another.

    Attributes:
        link: to the process, which sends something when it is ready and after each job.
        key: of its job; None before the first.
        until: when the job has to be done, by the monotonic clock.
    """

    def __init__(self, work: Callable[..., object], threads: int) -> None:
        self.link, theirs = _SPAWN.Pipe()
        self.key: Key | None = None
        self.until = inf
        self._process = _SPAWN.Process(target=_serve, args=(work, threads, theirs), daemon=True)
        self._process.start()
        theirs.close()

    def answered(self) -> bool:
        """Whether the process has sent word, and not come to its end, which reads as word, too."""
        with suppress(EOFError):
            self.link.recv()
            return True
        return False

    def begin(self, key: Key, job: tuple[Any, ...], limit_s: float) -> None:
        """Give the process a job, now that it is ready."""
        self.key, self.until = key, monotonic() + limit_s
        self.link.send(job)

    def stop(self) -> None:
        """End the process, and the compilers that it has started."""
        if os.name == "posix":
            with suppress(ProcessLookupError):  # it has not come so far as to have a group
                os.killpg(self._process.pid or 0, signal.SIGKILL)
        self._process.kill()
        self._process.join()


def compile_ahead(
    work: Callable[..., object],
    jobs: Mapping[Key, tuple[Any, ...]],
    limit_s: float,
    threads: int,
    advance: Callable[[Key], None] = lambda key: None,
) -> dict[Key, str]:
    """Do jobs in two other processes, and stop what takes too long.

    Args:
        work: a function of a module; what it returns or raises is lost.
        jobs: its arguments; those that cannot be sent to another process are passed over.
        limit_s: seconds that a job may take, not counting what a process needs to start and to load torch.
        threads: of torch, which the compiled code depends on.
        advance: called with each key before its job begins.

    Returns:
        Why not, for each key whose job was not done: it was stopped, or its process broke down.
    """
    todo = [(key, job) for key, job in reversed(tuple(jobs.items())) if _can_be_sent(job)]
    undone: dict[Key, str] = {}
    workers: list[_Worker[Key]] = [_Worker(work, threads) for _ in range(min(_WORKERS, len(todo)))]
    try:
        while workers:
            heard = wait([worker.link for worker in workers], _LOOK_S)
            for worker in list(workers):
                if worker.link not in heard and monotonic() < worker.until:
                    continue
                if worker.link in heard and worker.answered():
                    if todo:
                        key, job = todo.pop()
                        advance(key)
                        worker.begin(key, job, limit_s)
                        continue
                elif worker.key is not None:
                    late = f"to compile it takes more than {in_time(limit_s)}"
                    undone[worker.key] = _BROKEN if worker.link in heard else late
                worker.stop()
                workers.remove(worker)
                if todo and worker.key is not None:  # one that could not even start would not start again
                    workers.append(_Worker(work, threads))
    finally:
        for worker in workers:
            worker.stop()
    return undone


def _can_be_sent(job: tuple[Any, ...]) -> bool:
    with suppress(pickle.PicklingError, AttributeError, TypeError):  # it depends on what is in it
        pickle.dumps(job)
        return True
    return False


def _serve(work: Callable[..., object], threads: int, link: Connection) -> None:
    """What the process of a worker does, until the link is closed."""
    if os.name == "posix":
        os.setsid()  # a group of its own, with all that it starts
    os.environ["TORCHINDUCTOR_COMPILE_THREADS"] = "1"  # there are as many workers as processors
    with torch_threads(threads), suppress(EOFError, OSError):
        while True:
            link.send(None)
            job = link.recv()
            with suppress(Exception):  # whatever it raises comes again where it is not lost
                work(*job)
