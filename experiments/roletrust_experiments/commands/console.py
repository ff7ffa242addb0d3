"""Output of the commands: tables, progress bars and messages."""

import json
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from time import monotonic
from typing import Any, TypeVar

from rich import progress
from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleDimensions
from rich.markup import escape
from rich.table import Table

ALLOW_CODE = (
    "Accept files that name classes that are not installed, as package.module:Class. This "
    "runs their code."
)
"""Help of the option `--allow-code`, for commands whose files name models or attacks."""

_PERIOD = 10.0  # seconds
_UNWRAPPED = 10_000  # characters of a line

Item = TypeVar("Item")


class _Lines(Console):
    """A console that wraps nothing in a file or a pipe: a row of a table is one line, and a name
    is whole.
    """

    @property
    def size(self) -> ConsoleDimensions:
        """Width and height in characters."""
        if self.file.isatty() or "COLUMNS" in os.environ:
            return super().size
        return ConsoleDimensions(_UNWRAPPED, super().size.height)

    @size.setter
    def size(self, size: tuple[int, int]) -> None:
        raise AttributeError("the terminal decides its size")


console = _Lines(highlight=False, emoji=False)
errors = _Lines(stderr=True, highlight=False, emoji=False)


class _ProgressLog(progress.Progress):
    """Progress as lines, where no bar can move: at most one in `_PERIOD` seconds, so short commands
    print none.
    """

    def __init__(self, *columns: progress.ProgressColumn, **options: Any) -> None:
        super().__init__(*columns, **options, disable=True)
        self._parts, self._due = columns, monotonic() + _PERIOD

    def update(self, task_id: progress.TaskID, **fields: Any) -> None:
        """Print a line if one is due. See `Progress.update`."""
        super().update(task_id, **fields)
        if monotonic() >= self._due:
            self._due = monotonic() + _PERIOD
            self.console.print(
                *(part(self._tasks[task_id]) for part in self._parts), soft_wrap=True
            )

    def advance(self, task_id: progress.TaskID, advance: float = 1) -> None:
        """See `Progress.advance`."""
        self.update(task_id, advance=advance)


def progress_bar(where: Console = console, *, counted: bool = True) -> progress.Progress:
    """Return a progress bar that disappears when it is done; in a file, a pipe or a notebook, lines
    in its place.

    There a bar would be printed again and again, although all of these may ask for colours through
    `FORCE_COLOR`.

    Args:
        where: Console that shows it.
        counted: Whether it shows how many steps are done. Else steps may differ in length, and come
            seldom.
    """
    ends = (progress.MofNCompleteColumn(), progress.TimeRemainingColumn())[not counted :]
    bar = where.file.isatty()
    kind, share = (
        (progress.Progress, progress.BarColumn())
        if bar
        else (_ProgressLog, progress.TaskProgressColumn())
    )
    words, period = (
        progress.TextColumn("{task.description}", markup=False),
        30.0 if counted else math.inf,
    )
    return kind(words, share, *ends, console=where, transient=True, speed_estimate_period=period)


def stage(
    bar: progress.Progress, description: str, total: float | None = None
) -> Callable[..., None]:
    """Show a stage of the work in place of those before it, and return a function of what is done,
    and of how many.
    """
    for earlier in bar.task_ids:
        bar.remove_task(earlier)
    task = bar.add_task(description, total=total)
    return lambda done, total=total: bar.update(task, completed=done, total=total)


def stages(bar: progress.Progress) -> Callable[[str, float], None]:
    """Return a function of what is done, and of the share of it that is done, which shows it."""
    shown_stage, advance = "", stage(bar, "", 1.0)

    def show(what: str, share: float) -> None:
        nonlocal shown_stage, advance
        if what != shown_stage:
            shown_stage, advance = what, stage(bar, what, 1.0)
        advance(share)

    return show


def tracked(bar: progress.Progress, description: str, items: Sequence[Item]) -> Iterator[Item]:
    """Iterate over some items, as a `stage` of the work."""
    advance = stage(bar, description, len(items))
    for done, item in enumerate(items, 1):
        yield item
        advance(done)


def print_json(data: Mapping[str, Any]) -> None:
    """Print plain data for scripts: neither wrapped nor coloured, in ASCII, which every terminal
    can show.
    """
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
    """Return a table of numbers with names of rows under the heading `name`. No number is
    wrapped.
    """
    table = plain_table(title, caption)
    table.add_column(name, overflow="fold")
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def shown(text: str) -> str:
    """Return a text of others, such as a name in a log, for a console: without markup and orders to
    the terminal.
    """
    return escape(re.sub("[\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", "\ufffd", text))


def tell(line: str, style: str = "", where: Console = console) -> None:
    """Print a line that may have texts of others, as it is, in a style such as `dim`."""
    where.print(shown(line), style=style, soft_wrap=True)


def tell_left_out(reason: str) -> None:
    """Say what is left out of a result, and why."""
    console.print(f"[dark_orange3]left out:[/] {shown(reason)}", soft_wrap=True)


def short(text: str) -> str:
    """Return numbers without the zero before their point and without spaces around ±, for tables of
    80 columns.

    Example:
        >>> short("0.25 (-0.5, 10.5)"), short("0.25 ± 0.5")
        ('.25 (-.5, 10.5)', '.25±.5')
    """
    return re.sub(r"(?<!\d)0\.", ".", text).replace(" ± ", "±")
