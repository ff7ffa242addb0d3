"""Compilation before timing, in separate processes that can be stopped, into torch's cache on disk.

The timing process and later runs find the compiled code in the cache, so that an interrupted run continues where it
stopped. They compile again if torch considers their settings different. The folder of the cache is torch's own, see
its TORCHINDUCTOR_CACHE_DIR.
"""

import pickle
from collections.abc import Callable, Hashable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, TypeVar

from roletrust_env.benchmarking.pool import WorkerPool
from roletrust_env.evaluation.resources import in_time
from studies.timing.threads import torch_threads

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
    """Run jobs in two other processes, and stop those that take too long.

    Args:
        work: Function of a module; its results and exceptions are discarded.
        jobs: Arguments of the function; those that cannot be pickled are skipped.
        limit_s: Time limit of a job in seconds, without the start of the process and the import of torch.
        threads: Number of threads of torch, which the compiled code depends on.
        advance: Called with each key before its job begins.

    Returns:
        The reason for each key whose job did not finish: it was stopped, or its process crashed.
    """
    sent = {key: job for key, job in jobs.items() if _can_be_sent(job)}
    undone: dict[Key, str] = {}
    crew: WorkerPool[Key] = WorkerPool(partial(_compile, work), _WORKERS, _ENVIRONMENT, partial(_load_torch, threads))
    with crew, suppress(ChildProcessError):
        for key, answer in crew.run(sent, limit_s, advance=advance):
            if answer.timed_out:
                undone[key] = f"compiling takes more than {in_time(limit_s)}"
            elif answer.exit_code is not None:
                undone[key] = "the compiling process crashed"
    return undone


def _can_be_sent(job: tuple[Any, ...]) -> bool:
    with suppress(pickle.PicklingError, AttributeError, TypeError):  # pickle raises different errors
        pickle.dumps(job)
        return True
    return False


def _compile(work: Callable[..., object], *job: Any) -> None:
    """Run a job."""
    with suppress(Exception):  # the timing process raises it again
        work(*job)


def _load_torch(threads: int) -> None:
    """Set the number of threads of torch, if it is installed."""
    torch_threads(threads).__enter__()
