"""Output of the commands: tables, progress bars and messages."""

import json
import math
import re
from collections.abc import Mapping
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

ALLOW_CODE = "Accept files that name classes that are not installed, as package.module:Class. This runs their code."
"""Help of the option `--allow-code`, for commands whose files name models or attacks."""

console = Console(highlight=False)
errors = Console(stderr=True, highlight=False)


def progress_bar(where: Console = console, *, counted: bool = True) -> Progress:
    """Return a progress bar that disappears when it is done.

    It is shown on a terminal only. In a file, a pipe or a notebook it would be printed again and again, and all of
    these may ask for colours through `FORCE_COLOR`.

    Args:
        where: Console that shows it.
        counted: Whether it shows how many steps are done. Else steps may differ in length, and come seldom.
    """
    ends = (MofNCompleteColumn(), TimeRemainingColumn())[not counted :]
    columns, period = (TextColumn("{task.description}"), BarColumn(), *ends), 30.0 if counted else math.inf
    shown = where.file.isatty()
    return Progress(*columns, console=where, transient=True, disable=not shown, speed_estimate_period=period)


def print_json(data: Mapping[str, Any]) -> None:
    """Print plain data for scripts: neither wrapped nor coloured, in ASCII, which every terminal can show."""
    print(json.dumps(data, indent=2, allow_nan=False))


def plain_table(title: str, caption: str = "") -> Table:
    """Return a table without columns, with a heading above it and an explanation below it."""
    return Table(
        title=title,
        caption=caption or None,
        title_justify="left",
        title_style="bold",
        caption_justify="left",
        box=SIMPLE_HEAD,
        pad_edge=False,
        show_edge=False,
    )


def number_table(title: str, caption: str, *headings: str, name: str = "") -> Table:
    """Return a table of numbers with names of rows under the heading `name`. No number is wrapped."""
    table = plain_table(title, caption)
    table.add_column(name, overflow="fold")
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def short(text: str) -> str:
    """Return numbers without the zero before their point and without spaces around ±, for tables of 80 columns.

    Example:
        >>> short("0.25 (-0.5, 10.5)"), short("0.25 ± 0.5")
        ('.25 (-.5, 10.5)', '.25±.5')
    """
    return re.sub(r"(?<!\d)0\.", ".", text).replace(" ± ", "±")
