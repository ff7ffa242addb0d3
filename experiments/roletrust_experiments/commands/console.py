"""Output of the commands: tables, progress bars and messages."""

import json
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from inspect import signature
from typing import TYPE_CHECKING, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, JustifyMethod, RenderResult
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Column, Table
from rich.text import Text

if TYPE_CHECKING:
    from roletrust_env.metrics.confidence import Estimate

ALLOW_CODE = "Accept files that name classes that are not installed, as package.module:Class. This runs their code."
"""Help of the option `--allow-code`, for commands whose files name models or attacks."""

_NAME = 20
"""Width that the first column, of names, keeps at least, in letters; longer names wrap."""

_TEXT = 10
"""Width that a column of texts keeps at least, in letters."""

console = Console(highlight=False)
errors = Console(stderr=True, highlight=False)


class FittedTable(Table):
    """A table that fits the terminal: long names wrap, and the last columns are left out where there is no room.

    Nothing is ever cut. The caption says which columns are left out.

    Args:
        title: Heading above the table.
        caption: Explanation below the table.
        needed: Number of leading columns that are never left out.
    """

    def __init__(self, title: str, caption: str = "", *, needed: int = 2) -> None:
        super().__init__(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
        self.caption, self.caption_justify, self.show_edge = caption, "left", False
        self._needed = needed

    def column(self, heading: str, justify: JustifyMethod = "left", style: str | None = None) -> None:
        """Add a column whose cells wrap."""
        self.add_column(heading, justify=justify, style=style, overflow="fold")

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Leave out what does not fit, and print the rest."""
        left_out: list[str] = []
        gap = sum(self.padding[1::2]) + 1
        while not (fits := sum(map(_width, self.columns)) + gap * len(self.columns) <= options.max_width + gap):
            if len(self.columns) <= self._needed:
                break
            left_out.insert(0, str(self.columns.pop().header).replace("\n", " "))
        for column in self.columns if fits else ():
            column.min_width = _width(column)
        if left_out:
            self.caption = f"{self.caption}\n" * bool(self.caption) + f"too narrow for: {', '.join(left_out)}"
        yield from super().__rich_console__(console, options)


def _width(column: Column) -> int:
    """Return the width that a column needs: its longest line, or less for names and texts that wrap."""
    cells = (Text.from_markup(str(cell)).plain for cell in (column.header, *column.cells))
    longest = max(cell_len(line) for text in cells for line in text.splitlines() or [""])
    return longest if column.justify == "right" else min(longest, _TEXT if column._index else _NAME)


def progress_bar(where: Console = console, columns: Sequence[ProgressColumn] = ()) -> Progress:
    """Return a progress bar that disappears when it is done.

    It is shown on a terminal only. In a file, a pipe or a notebook it would be printed again and again, and all of
    these may ask for colours through `FORCE_COLOR`.

    Args:
        where: Console that shows it.
        columns: Columns of the bar; by default a count of rounds.
    """
    usual = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*(columns or usual), console=where, transient=True, disable=not where.file.isatty())


@contextmanager
def interruptible(what: str) -> Iterator[None]:
    """Say what to do when the user interrupts work of which each finished part is saved.

    Args:
        what: The parts, such as `runs`.

    Raises:
        typer.Exit: The user interrupted it.
    """
    try:
        yield
    except KeyboardInterrupt:
        errors.print(f"Stopped. Finished {what} are saved; repeat the command without --force.", soft_wrap=True)
        raise typer.Exit(130) from None


def print_json(data: Mapping[str, Any]) -> None:
    """Print plain data for scripts: neither wrapped nor coloured, in ASCII, which every terminal can show."""
    print(json.dumps(data, indent=2, allow_nan=False))


def needs_code(names: Iterable[str]) -> str | None:
    """Return the option `--allow-code` where a spec as `package.module:Class` or an address needs it, else None."""
    from roletrust_env.trust.outside import KINDS

    foreign = (name for name in names if re.match(r"[\w.]+:\w+(?!\w*=)", name) or name.partition(":")[0] in KINDS)
    return "--allow-code" if any(foreign) else None


def print_next(*words: object, where: Console = console) -> None:
    """Print the command that is useful next, ready to be copied.

    Args:
        words: Words of the command behind `roletrust`; None and empty lists are left out, and lists are unpacked.
        where: Console that shows it.
    """
    flat = [part for word in words for part in (word if isinstance(word, list | tuple) else [word])]
    command = shlex.join(["roletrust", *(str(part) for part in flat if part is not None)])
    where.print(f"[dim]Next: {escape(command)}[/]", soft_wrap=True)


def option(name: str, values: Sequence[object] | object | None, default: object = None) -> list[str]:
    """Return an option as words of a command: once for each value, and not at all for the default.

    Example:
        >>> option("--model", ["mean", "median"]), option("--seed", 0, 0)
        (['--model', 'mean', '--model', 'median'], [])
    """
    several = list(values) if isinstance(values, list | tuple) else [values]
    return [] if values in (None, default) else [word for value in several for word in (name, str(value))]


def changed_options(command: Callable[..., Any], **values: Any) -> list[str]:
    """Return options of a command as words, without those that have their defaults.

    Args:
        command: Function of a Typer command, whose parameters have the names and the defaults of its options.
        **values: Values of its parameters.
    """
    words, parameters = [], signature(command).parameters
    for name, value in values.items():
        words += option(f"--{name.replace('_', '-')}", value, parameters[name].default)
    return words


def number_table(title: str, caption: str, *headings: str, name: str = "") -> FittedTable:
    """Return a table of numbers, with a name at the start of each row, under the heading `name`."""
    table = FittedTable(title, caption)
    table.column(name)
    for heading in headings:
        table.column(heading, "right")
    return table


def short(text: str) -> str:
    """Return numbers without the zero before their point and without spaces around ±, for tables of 80 columns.

    Example:
        >>> short("0.25 (-0.5, 10.5)"), short("0.25 ± 0.5")
        ('.25 (-.5, 10.5)', '.25±.5')
    """
    return re.sub(r"(?<!\d)0\.", ".", text).replace(" ± ", "±")


def plus_minus(value: "Estimate", digits: int = 3) -> str:
    """Return a mean and half its interval.

    Example:
        >>> from roletrust_env.metrics.confidence import Estimate
        >>> plus_minus(Estimate(0.25, 0.0121))
        '0.250 ± 0.012'
    """
    return f"{value.mean + 0.0:.{digits}f} ± {value.half:.{digits}f}"
