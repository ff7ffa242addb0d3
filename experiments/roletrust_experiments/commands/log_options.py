"""Options by which commands read a log of ratings."""

from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from roletrust_env.errors import suggest
from roletrust_env.evaluation.specs import parse_settings
from roletrust_env.logs.columns import COLUMNS
from roletrust_env.logs.log import Log
from roletrust_env.logs.log import read as read_log
from roletrust_env.logs.sources import Reading
from roletrust_experiments.commands.console import tell

_KEYS = tuple(field.name for field in fields(Reading))

_option = partial(typer.Option, rich_help_panel="Reading")


@dataclass(frozen=True)
class LogOptions:
    """Options by which a log is read; the help of each says what it is."""

    columns: Annotated[
        str,
        _option(
            metavar="COLUMN=NAME,...",
            help=f"Names of columns: {', '.join(f'{name}=...' for name in COLUMNS)}. Usual names "
            "are found.",
        ),
    ] = ""
    read: Annotated[
        list[str] | None,
        _option(
            metavar="KEY=VALUE",
            help=f"How the file is read; repeat for more: {', '.join(_KEYS)}.",
        ),
    ] = None
    scale: Annotated[
        tuple[float, float], _option(help="Worst and best rating.", metavar="WORST BEST")
    ] = (0.0, 1.0)
    every: Annotated[
        float | None,
        _option(help="Length of a round in seconds; 30 days in `audit` and `compare`."),
    ] = None
    same_agents: Annotated[
        bool, _option("--same-agents", help="A rater and a ratee of one name are one agent.")
    ] = False

    def reading(self) -> Reading:
        """Return what is known about the file.

        Raises:
            ValueError: A key is unknown, or a value is not allowed.
        """
        given = parse_settings(self.read or (), "--read")
        for key in given:
            if key not in _KEYS:
                raise ValueError(f"--read has no key {key!r}{suggest(key, _KEYS)}")
        missing = given.get("missing", ())
        listed = missing if isinstance(missing, tuple | list) else [missing]
        given["missing"] = tuple(map(str, listed))
        return Reading(**given)

    def log(self, path: Path, *, repeats: bool = False) -> Log:
        """Read a log, and print how it was read.

        Args:
            path: Path of the file.
            repeats: Whether rows may be the same, whatever `--read` says.

        Raises:
            ValueError: See `roletrust_env.logs.read`.
            OSError: The file cannot be read.
        """
        arguments = self.arguments()
        reading = arguments["reading"]
        arguments["reading"] = replace(reading, repeats=reading.repeats or repeats)
        log = read_log(path, **arguments)
        for note in log.notes:
            tell(note)
        return log

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of `roletrust_env.logs.read`.

        Raises:
            ValueError: See `reading` and `named_columns`.
        """
        columns = named_columns(self.columns)
        settings = {"scale": self.scale, "same_agents": self.same_agents}
        return {**columns, **settings, "reading": self.reading()}


def named_columns(text: str) -> dict[str, Any]:
    """Return the names of columns from `--columns`.

    Raises:
        ValueError: A part is not of the form `column=name`, or there is no such column.
    """
    names = dict[str, Any]()
    for part in text.split(",") if text else ():
        column, equals, name = part.partition("=")
        if not equals or column.strip() not in COLUMNS or column.strip() in names:
            raise ValueError(
                f"--columns has {part!r}; it must have parts such as rater=NAME, each once, of "
                f"{', '.join(COLUMNS)}"
            )
        names[column.strip()] = name
    return names
