"""`roletrust live load`: the load of a manager, by the size of its team."""

import os
import platform
import tempfile
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roletrust_env.storage.files import prepare_folder, replacing, write_csv
from roletrust_experiments.commands.console import console, number_table, progress_bar
from roletrust_experiments.commands.live.options import require_live

if TYPE_CHECKING:
    from roletrust_experiments.timing.live_load import Load

_SIDES = 3, 10, 100, 200
_HEADINGS = "team", "complete rounds", "CPU", "median", "largest", "memory", "grown by"
_CAPTION = (
    "A team has as many raters as providers. Each rater rates each provider {rate:g} times a second for {seconds:g} s, "
    "with signed ratings, on loopback. CPU is the manager's use of one core. Median and largest are "
    "times from the sending of the ratings to the arrival of the trust at a listener. Memory is that of the manager; "
    "grown by is the increase of its median from the first half of the time to the second. The raters and the listener "
    "run on the same machine."
)


def load(
    side: Annotated[
        list[int] | None,
        typer.Option(min=1, help="Number of raters and of providers; may be repeated; 3, 10, 100 and 200 by default."),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[:key=value,...]", help="Trust model of the manager; may be repeated; role-trust by default."
        ),
    ] = None,
    seconds: Annotated[float, typer.Option(min=2, help="Time for each team, seconds.")] = 30.0,
    rate: Annotated[float, typer.Option(min=0.1, max=20, help="Rounds per second.")] = 2.0,
    out: Annotated[
        Path | None, typer.Option(help="Folder for live-load.csv and live-load.md; it is created if it does not exist.")
    ] = None,
) -> None:
    """Measure the [bold]load of a manager[/] by team size: its processor time, memory and delay.

    Use a quiet machine, since other programs change the result.

    [bold]Examples[/]

    [dim]# half an hour of ten raters and ten providers[/]
    [cyan]roletrust live load --side 10 --seconds 1800[/]

    [dim]# the costs of other trust models[/]
    [cyan]roletrust live load --model travos --model fire --side 10 --side 100[/]
    """
    require_live()
    from roletrust_experiments.timing.live_load import load_model, measure_load

    if out is not None:
        prepare_folder(out)
    loads = []
    models = model or ["role-trust"]
    for text in models:
        load_model(text)
    with progress_bar() as progress:
        for text, number in product(models, side or _SIDES):
            task = progress.add_task(f"{text}, {number}x{number}", total=seconds)
            with tempfile.TemporaryDirectory() as folder:
                loads.append(
                    measure_load(
                        text,
                        number,
                        seconds,
                        rate,
                        Path(folder),
                        lambda spent, task=task: progress.update(task, completed=spent),  # type: ignore[misc]
                    )
                )
    caption = _CAPTION.format(rate=rate, seconds=seconds)
    table = number_table("The load of a manager", "", *_HEADINGS)
    for row in _lines(loads):
        table.add_row(*row)
    console.print(table)
    console.print(caption)
    if out is not None:
        write_csv(out / "live-load.csv", loads[0]._fields, loads)
        with replacing(out / "live-load.md") as path:
            path.write_text(_page(loads, caption), encoding="utf-8")
        console.print(f"Written to {out}: live-load.csv, live-load.md", soft_wrap=True)


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


def _page(loads: Sequence["Load"], caption: str) -> str:
    """Return the table as a Markdown page."""
    lines = [["trust model", *_HEADINGS], ["---", *["---:"] * len(_HEADINGS)], *_lines(loads)]
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    machine = f"{os.cpu_count()} cores of {platform.machine()}, Python {platform.python_version()}"
    written = f"Written by `roletrust live load` on {machine}; `make live-load` repeats the measurement."
    return "\n\n".join(["# The load of a manager", caption, table, written]) + "\n"
