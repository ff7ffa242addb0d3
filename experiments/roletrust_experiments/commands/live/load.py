"""`roletrust live load`: how large a team one manager of this machine can have."""

import os
import platform
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roletrust_env.storage.files import prepare_folder, replacing, write_csv
from roletrust_experiments.commands.console import console, number_table, progress_bar
from roletrust_experiments.commands.live.options import require_live

if TYPE_CHECKING:
    from roletrust_experiments.timing.live_load import Load

_SIDES = 3, 10, 100, 200
_HEADINGS = "complete rounds", "CPU", "median", "largest", "memory", "grown by"
_CAPTION = (
    "As many raters as providers, of whom all rate all {rate:g} times a second for {seconds:g} s; signed, on loopback, "
    "under role-trust. CPU is of the manager, as a share of a core; median and largest are from the moment at which "
    "ratings are sent to the trust that somebody else hears; memory is the manager's, and by what its median grew "
    "between the halves of the time. The raters and the listener share the machine."
)


def load(
    side: Annotated[
        list[int] | None,
        typer.Option(min=1, help="Raters, and as many providers; may be repeated; 3, 10, 100 and 200 if left out."),
    ] = None,
    seconds: Annotated[float, typer.Option(min=2, help="How long each team is measured.")] = 30.0,
    rate: Annotated[float, typer.Option(min=0.1, max=20, help="Rounds in a second.")] = 2.0,
    out: Annotated[
        Path | None, typer.Option(help="Folder for live-load.csv and live-load.md; it is made if need be.")
    ] = None,
) -> None:
    """Measure [bold]what a manager takes[/] of the processor and the memory, and how long trust takes, by team size.

    Use a quiet machine; what else runs there is measured with it.

    [bold]Examples[/]

    [dim]# half an hour of ten raters and ten providers[/]
    [cyan]roletrust live load --side 10 --seconds 1800[/]
    """
    require_live()
    from roletrust_experiments.timing.live_load import measure_load

    if out is not None:
        prepare_folder(out)
    found = []
    with progress_bar() as progress:
        for number in side or _SIDES:
            task = progress.add_task(f"{number}x{number}", total=seconds)
            with tempfile.TemporaryDirectory() as folder:
                found.append(
                    measure_load(
                        number,
                        seconds,
                        rate,
                        Path(folder),
                        lambda spent, task=task: progress.update(task, completed=spent),  # type: ignore[misc]
                    )
                )
    caption = _CAPTION.format(rate=rate, seconds=seconds)
    table = number_table("The load of a manager", "", *_HEADINGS)
    for row in _lines(found):
        table.add_row(*row)
    console.print(table)
    console.print(caption)
    if out is not None:
        write_csv(out / "live-load.csv", found[0]._fields, found)
        with replacing(out / "live-load.md") as path:
            path.write_text(_page(found, caption), encoding="utf-8")
        console.print(f"Written to {out}: live-load.csv, live-load.md", soft_wrap=True)


def _lines(found: Sequence["Load"]) -> list[list[str]]:
    return [
        [
            f"{one.raters}x{one.raters}",
            f"{one.complete:.0%} of {one.rounds}",
            f"{one.cpu:.1%}",
            f"{one.median_ms:.0f} ms",
            f"{one.largest_ms:.0f} ms",
            f"{one.memory_mb:.0f} MB",
            f"{one.grown_mb:.1f} MB",
        ]
        for one in found
    ]


def _page(found: Sequence["Load"], caption: str) -> str:
    """The table as a page of Markdown."""
    lines = [["team", *_HEADINGS], ["---", *["---:"] * len(_HEADINGS)], *_lines(found)]
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    machine = f"{os.cpu_count()} cores of {platform.machine()}, Python {platform.python_version()}"
    written = f"Written by `roletrust live load` on {machine}; `make live-load` measures again."
    return "\n\n".join(["# What a manager of a large team takes", caption, table, written]) + "\n"
