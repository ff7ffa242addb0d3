"""Compiling ahead of the timing: in processes of their own, which can be stopped, into torch's cache on disk.

What one process has compiled, others may find in the cache: the one that times it, and those of the next run, so that
a run that was broken off goes on where it was. Where torch takes their settings for others, they compile anew. The
cache is where torch keeps it, see its TORCHINDUCTOR_CACHE_DIR.
"""

import pickle
from collections.abc import Callable, Hashable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, TypeVar

from roletrust_env.benchmark.processes import WorkerPool
from roletrust_env.evaluation.resources import in_time
from roletrust_experiments.timing.threads import torch_threads

Key = TypeVar("Key", bound=Hashable)

_WORKERS = 2
_ENVIRONMENT = {"TORCHINDUCTOR_COMPILE_THREADS": "1"}  # there are as many workers as processors


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
    sent = {key: job for key, job in jobs.items() if _can_be_sent(job)}
    undone: dict[Key, str] = {}
    crew: WorkerPool[Key] = WorkerPool(partial(_compile, work), _WORKERS, _ENVIRONMENT, partial(_load_torch, threads))
    with crew, suppress(ChildProcessError):
        for key, answer in crew.run(sent, limit_s, advance=advance):
            if answer.timed_out:
                undone[key] = f"to compile it takes more than {in_time(limit_s)}"
            elif answer.exit_code is not None:
                undone[key] = "the process that compiled it broke down"
    return undone


def _can_be_sent(job: tuple[Any, ...]) -> bool:
    with suppress(pickle.PicklingError, AttributeError, TypeError):  # it depends on what is in it
        pickle.dumps(job)
        return True
    return False


def _compile(work: Callable[..., object], *job: Any) -> None:
    """Do a job."""
    with suppress(Exception):  # whatever it raises comes again where it is not lost
        work(*job)


def _load_torch(threads: int) -> None:
    """Let torch, where it is installed, work on so many threads from now on."""
    torch_threads(threads).__enter__()
