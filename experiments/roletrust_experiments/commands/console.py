"""Where the commands print, and how they show that they are at work."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from roletrust_experiments.paper.claims import Claim

ALLOW_CODE = "Let the file name classes that are not installed, package.module:Class, which runs what stands there."
"""What the option of that name does, wherever a file names models or attacks."""

console = Console(highlight=False)
errors = Console(stderr=True, highlight=False)


def progress_bar(where: Console = console, columns: Sequence[ProgressColumn] = ()) -> Progress:
    """A progress bar that leaves no trace when done.

    There is none where it would be printed over and over instead of moving: in a file, a pipe or a notebook, which may
    all ask for colours by `FORCE_COLOR`.

    Args:
        where: it is shown.
        columns: of it; by default those that count rounds.
    """
    usual = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*(columns or usual), console=where, transient=True, disable=not where.file.isatty())


def print_json(data: Mapping[str, Any]) -> None:
    """Print plain data for scripts: as it is, neither wrapped nor coloured, in letters that any terminal takes."""
    print(json.dumps(data, indent=2, allow_nan=False))


def number_table(title: str, caption: str, *headings: str) -> Table:
    """A table of numbers, each row with a name before them."""
    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    table.caption, table.caption_justify = caption, "left"
    table.add_column("")
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def claims_table(title: str, found: Sequence[Claim]) -> Table:
    """What the paper says, what is needed and what was measured, claim by claim."""
    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    for heading in ("fig", "what", "the paper", "needed", "measured", ""):
        table.add_column(heading, justify="right" if heading == "measured" else "left", no_wrap=True)
    for claim, following in zip(found, [*found[1:], None], strict=True):
        verdict = {True: "[green]ok[/]", False: "[bold red]not ok[/]", None: "[dim]n/a[/]"}[claim.ok]
        ends = following is not None and following.figure != claim.figure
        table.add_row(
            str(claim.figure), claim.what, claim.paper, claim.needed, claim.measured, verdict, end_section=ends
        )
    return table
