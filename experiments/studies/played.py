"""Runs of a command: played with a progress bar, each kept in a file when it is finished."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from rich.markup import escape

from roletrust_env.benchmarking.pool import cores
from roletrust_experiments.commands.console import console, interruptible, progress_bar
from studies.attackers.runs import Run, Work, play_runs, write_runs


def play_and_keep(
    work: Work,
    jobs: Mapping[str, tuple[Any, ...]],
    runs: dict[str, Run],
    *,
    total: int,
    workers: int | None,
    settings: Mapping[str, Any],
    path: Path,
    merge: Callable[[Run, Run], Run] = lambda before, run: run,
) -> list[str]:
    """Play runs, add them to those that are there, and write all to a file after each.

    Args:
        work: Function that plays a run.
        jobs: Arguments of each missing run, by key.
        runs: Runs that are there, by key.
        total: Number of all runs that are wanted.
        workers: Number of processes; None is one for each core.
        settings: Settings that the runs have in common.
        path: Path of the file.
        merge: Function that adds a run to an earlier one with the same key.

    Returns:
        A line for each run that failed; these are not kept.

    Raises:
        typer.Exit: The user interrupted the command.
    """
    failed = []
    with progress_bar() as progress:
        bar = progress.add_task("Playing", total=total, completed=total - len(jobs))
        if len(jobs) < total:
            progress.console.print(f"[dim]{total - len(jobs):,} of {total:,} runs are there already.[/]")
        with interruptible("runs"):
            for key, run in play_runs(work, jobs, workers or cores()):
                progress.advance(bar)
                if "failed" in run:
                    failed.append(f"{key}: {run['failed']}")
                    continue
                runs[key] = merge(runs.get(key, {}), run)
                write_runs(path, settings, runs)
    for line in failed:
        console.print(f"[red]{escape(line)}[/]", soft_wrap=True)
    return failed
