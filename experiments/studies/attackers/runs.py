"""Runs that are kept in a JSON file, so that an interrupted command continues with those that are missing."""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from roletrust_env.benchmarking.pool import ONE_THREAD, TRIES, WorkerPool
from roletrust_env.benchmarking.schema import reason
from roletrust_env.metrics.confidence import Estimate, estimate
from roletrust_env.storage.files import write_json
from roletrust_env.storage.untrusted import UntrustedModel, check_plain, parse_json

Run = dict[str, Any]
"""Result of a run as plain data; `failed` has the reason of a run that raised an error."""

Work = Callable[..., Run]
"""Function of a module that plays a run."""

Check = Callable[[str, Run], object]
"""Check of a run with its key; a `ValueError` says what is damaged."""

_INSTEAD = "give --force to begin again, or another --out"


def read_runs(path: Path, settings: Mapping[str, Any], check: Check) -> dict[str, Run]:
    """Return the stored runs by key; none if the file does not exist.

    Args:
        path: Path of the file.
        settings: Settings that the runs must have, as plain data.
        check: Check of each run, see `Check`.

    Raises:
        ValueError: The file or a run in it is damaged, or the runs have other settings; the message names the file.
    """
    if not path.exists():
        return {}
    wanted = json.loads(json.dumps(settings))
    try:
        made_with, runs = _parts(parse_json(path.read_bytes()))
        if made_with == wanted:
            for key, run in runs.items():
                _check_run(check, key, run)
    except (ValueError, RecursionError) as error:
        told = "it is nested too deeply" if isinstance(error, RecursionError) else reason(error)
        raise ValueError(f"{path} holds no runs of this command: {told}; {_INSTEAD}") from None
    if made_with != wanted:
        other = [name for name in wanted if made_with.get(name) != wanted[name]]
        raise ValueError(f"{path} holds runs with another {', '.join(other) or 'set of settings'}; {_INSTEAD}")
    return runs


def _parts(data: Any) -> tuple[dict[str, Any], dict[str, Run]]:
    """Return the settings and the runs of a file."""
    if not isinstance(data, dict):
        raise ValueError("it is no object with made_with and runs")
    for name in ("made_with", "runs"):
        if not isinstance(data.get(name), dict):
            raise ValueError(f"it has no object {name}")
    return data["made_with"], data["runs"]


def _check_run(check: Check, key: str, run: Any) -> None:
    try:
        if not isinstance(run, dict):
            raise ValueError("it is no object")
        check(key, run)
    except ValueError as error:
        raise ValueError(f"run {key!r}: {reason(error)}") from None


def of_kind(kind: type[UntrustedModel]) -> Check:
    """Return the check of runs that all have the fields of a class."""
    return lambda key, run: check_plain(kind, run)


def write_runs(path: Path, settings: Mapping[str, Any], runs: Mapping[str, Run]) -> None:
    """Write the runs and the settings that they have in common, in an order that does not depend on their end."""
    write_json(path, {"made_with": settings, "runs": {key: runs[key] for key in sorted(runs)}})


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
