"""Runs that are kept in a JSON file, so that an interrupted command continues with those that are missing."""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from roletrust_env.benchmark.pool import ONE_THREAD, TRIES
from roletrust_env.benchmark.processes import WorkerPool
from roletrust_env.benchmark.schema import reason
from roletrust_env.metrics.confidence import Estimate, estimate
from roletrust_env.storage.files import write_json

Run = dict[str, Any]
"""Result of a run as plain data; `failed` has the reason of a run that raised an error."""

Work = Callable[..., Run]
"""Function of a module that plays a run."""


def read_runs(path: Path, settings: Mapping[str, Any]) -> dict[str, Run]:
    """Return the stored runs by key; none if the file does not exist.

    Args:
        path: Path of the file.
        settings: Settings that the runs must have, as plain data.

    Raises:
        ValueError: The file holds something else, or runs with other settings.
    """
    if not path.exists():
        return {}
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        made_with, runs = data["made_with"], {str(key): dict(run) for key, run in data["runs"].items()}
    except (ValueError, KeyError, TypeError, AttributeError):
        raise ValueError(f"{path} holds no runs of this command; remove it, or choose another folder") from None
    if made_with != json.loads(json.dumps(settings)):
        other = [name for name in settings if made_with.get(name) != json.loads(json.dumps(settings[name]))]
        raise ValueError(
            f"{path} holds runs with another {', '.join(other) or 'set of settings'}; "
            "give --force to begin again, or choose another folder"
        )
    return runs


def write_runs(path: Path, settings: Mapping[str, Any], runs: Mapping[str, Run]) -> None:
    """Write the runs and the settings that they have in common."""
    write_json(path, {"made_with": settings, "runs": runs})


def play_runs(work: Work, jobs: Mapping[str, tuple[Any, ...]], workers: int) -> Iterator[tuple[str, Run]]:
    """Play runs and yield each with its key when it is finished.

    Args:
        work: Function that plays a run.
        jobs: Arguments of each run, by key.
        workers: Number of processes; 1 plays in this process.
    """
    if workers == 1:
        for key, arguments in jobs.items():
            yield key, _play_safely(work, *arguments)
        return
    pool: WorkerPool[str] = WorkerPool(_play_safely, workers, ONE_THREAD)
    with pool:
        for key, result in pool.run({key: (work, *arguments) for key, arguments in jobs.items()}, math.inf, TRIES):
            died = {"failed": f"its process died {TRIES} times, the last time with exit code {result.exit_code}"}
            yield key, died if result.exit_code is not None else result.value


def mean_of(values: list[float | None]) -> Estimate:
    """Return the mean over runs with its 95% interval. None counts as undefined."""
    return estimate(np.array([math.nan if value is None else value for value in values], np.float64))


def _play_safely(work: Work, *arguments: Any) -> Run:
    """Play a run. An exception of a trust model or an attacker becomes a failed run."""
    try:
        return work(*arguments)
    except (Exception, SystemExit) as error:  # plug-in code may raise anything
        return {"failed": reason(error)}
