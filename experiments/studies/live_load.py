"""`python -m studies.live_load`: the load of a manager, by the size of its team."""

import os
import platform
import tempfile
from collections.abc import Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import Progress, TaskID

from roletrust_env.storage.files import prepare_folder, replacing, write_csv
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust import trust_models
from roletrust_experiments.commands.console import console, errors, number_table, progress_bar
from roletrust_experiments.commands.live.options import require_live
from studies.running import run

if TYPE_CHECKING:
    from studies.timing.live_load import Load

_SIDES, _SIDES_OF_MODELS = (3, 10, 100, 200), (10, 100)
_HEADINGS = "team", "complete rounds", "CPU", "median", "largest", "memory", "grown by"
_CAPTION = (
    "A team has as many raters as providers. Each rater rates each provider {rate:g} times a second for {seconds:g} s, "
    "with signed ratings, on loopback. CPU is the manager's use of one core. Median and largest are "
    "times from the sending of the ratings to the arrival of the trust at a listener. Memory is that of the manager; "
    "grown by is the increase of its median from the first half of the time to the second. The raters and the listener "
    "run on the same machine."
)
_CAPTION_OF_MODELS = (
    "CPU time of the manager for one round in ms, with all that a round takes: ratings are received, checked and "
    "matched, trust is updated, written to disk and published. A team has as many raters as providers. Each rater "
    "rates each provider {rate:g} times a second for {seconds:g} s, with signed ratings, on loopback. A dash marks a "
    "team that did not get together. The file live-load.csv also has the delays and the share of complete rounds."
)


def load(
    side: Annotated[
        list[int] | None,
        typer.Option(
            min=1,
            help="Number of raters and of providers; may be repeated; 3, 10, 100 and 200 by default, and 10 and 100 "
            "for several trust models.",
        ),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[:key=value,...]", help="Trust model of the manager; may be repeated; role-trust by default."
        ),
    ] = None,
    all_models: Annotated[bool, typer.Option("--all-models", help="Measure all installed trust models.")] = False,
    seconds: Annotated[float, typer.Option(min=2, help="Time for each team, seconds.")] = 30.0,
    rate: Annotated[float, typer.Option(min=0.1, max=20, help="Rounds per second.")] = 2.0,
    out: Annotated[
        Path | None, typer.Option(help="Folder for live-load.csv and live-load.md; it is created if it does not exist.")
    ] = None,
) -> None:
    """Measure the [bold]load of a manager[/] by team size: its processor time, memory and delay.

    Use a quiet machine, since other programs change the result. For several trust models, the table has the processor
    time of one round, which they change less.

    [bold]Examples[/]

    [dim]# half an hour of ten raters and ten providers[/]
    [cyan]python -m studies.live_load --side 10 --seconds 1800[/]

    [dim]# the costs of all trust models, some 20 minutes[/]
    [cyan]python -m studies.live_load --all-models --seconds 10[/]
    """
    require_live()
    from studies.timing.live_load import Load, TeamIncompleteError, load_model, measure_load

    if all_models and model:
        raise ValueError("--all-models and --model exclude each other")
    models = list(trust_models()) if all_models else model or ["role-trust"]
    for text in models:
        load_model(text)
    several = len(models) > 1
    sides = tuple(side or (_SIDES_OF_MODELS if several else _SIDES))
    if out is not None:
        prepare_folder(out)
    loads = list[Load]()
    with progress_bar() as progress:
        for text, number in product(models, sides):
            task = progress.add_task(f"{text}, {number}x{number}", total=seconds)
            with tempfile.TemporaryDirectory() as folder:
                advance = partial(_advance, progress, task)
                try:
                    loads.append(measure_load(text, number, seconds, rate, Path(folder), advance))
                except TeamIncompleteError as error:
                    if not several:
                        raise
                    errors.print(f"{text}: {error}", markup=False, soft_wrap=True)
    if several:
        headings, lines = _by_model(loads, models, sides)
        caption = _CAPTION_OF_MODELS.format(rate=rate, seconds=seconds)
    else:
        headings, lines = list(_HEADINGS), _lines(loads)
        caption = _CAPTION.format(rate=rate, seconds=seconds)
    table = number_table("The load of a manager", "", *headings, name="trust model")
    for row in lines:
        table.add_row(*row)
    console.print(table)
    console.print(caption)
    if out is not None:
        write_csv(out / "live-load.csv", Load._fields, loads)
        with replacing(out / "live-load.md") as path:
            path.write_text(_page(headings, lines, caption, by_model=several), encoding="utf-8")
        console.print(f"Written to {out}: live-load.csv, live-load.md", soft_wrap=True)


def _advance(progress: Progress, task: TaskID, spent: float) -> None:
    progress.update(task, completed=spent)


def _by_model(
    loads: Sequence["Load"], models: Sequence[str], sides: Sequence[int]
) -> tuple[list[str], list[list[str]]]:
    """Return headings and lines of a table with a line for each trust model and a column for each size."""
    found = {(one.model, one.raters): one for one in loads}
    lines = [[text, *(_cpu_of_round(found.get((text, side))) for side in sides)] for text in models]
    return [f"{side}x{side}" for side in sides], lines


def _cpu_of_round(load: "Load | None") -> str:
    if load is None or not load.rounds:
        return "-"
    return f"{load.round_cpu_ms:.1f}"


def _lines(loads: Sequence["Load"]) -> list[list[str]]:
    return [
        [
            one.model,
            f"{one.raters}x{one.raters}",
            f"{one.complete:.0%} of {one.rounds}",
            f"{one.cpu:.1%}",
            f"{one.median_ms:.0f} ms",
            f"{one.largest_ms:.0f} ms",
            f"{one.memory_mb:.0f} MB",
            f"{one.grown_mb:.1f} MB",
        ]
        for one in loads
    ]


def _page(headings: Sequence[str], lines: Sequence[Sequence[str]], caption: str, *, by_model: bool) -> str:
    """Return the table as a Markdown page."""
    table = markdown_table(["trust model", *headings], lines, names=1)
    title = f"# The load of a manager{', by trust model' if by_model else ''}"
    machine = f"{os.cpu_count()} cores of {platform.machine()}, Python {platform.python_version()}"
    written = f"Written by `python -m studies.live_load` on {machine}; `make live-load` repeats the measurement."
    return "\n\n".join([title, caption, table, written]) + "\n"


if __name__ == "__main__":
    run(load)
