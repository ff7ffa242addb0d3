"""Options by which commands read a log of ratings."""

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any

import typer

from roletrust_env.logs.columns import COLUMNS
from roletrust_env.logs.log import Log
from roletrust_env.logs.log import read as read_log
from roletrust_env.logs.sources import Reading
from roletrust_experiments.commands.console import tell
from roletrust_experiments.commands.options import keyword_option, parse_keywords

READING = {
    "rater, ratee, rating, time": "names of columns, where no usual name fits, or numbers from 1",
    "same_agents": "true if a rater and a ratee of one name are one agent",
    "skip": "lines before the table",
    "header": "false if the first row is data",
    "separator": "between two columns",
    "encoding": "of a text",
    "decimal": "decimal mark",
    "time_format": "form of dates, such as %d.%m.%Y",
    "time_unit": "s, ms, us or ns",
    "labels": "numbers of ratings that are texts, such as {yes=1, no=0}",
    "missing": "texts of a missing value",
    "repeats": "true if rows may be the same",
    "table": "of a database or workbook",
}
"""What each keyword of a log is."""

Ratings = Annotated[Path, typer.Argument(help="File of ratings, as for `roletrust rate`.")]
Scale = Annotated[
    tuple[float, float], typer.Option(help="Worst and best rating.", metavar="WORST BEST")
]
LogSettings = Annotated[list[str] | None, keyword_option("--set", READING)]


def log_arguments(
    settings: Sequence[str] | None, scale: tuple[float, float], *further: str
) -> dict[str, Any]:
    """Return the arguments of `roletrust_env.logs.read`, and further ones.

    Args:
        settings: Texts `KEY=VALUE`.
        scale: Worst and best rating.
        *further: Names of further arguments that may be set.

    Raises:
        ValueError: A text has another form, or a keyword is unknown.
    """
    of_reading = [field.name for field in fields(Reading)]
    given = parse_keywords(settings, "--set", (*COLUMNS, "same_agents", *of_reading, *further))
    names = {text.partition("=")[0].strip(): text.partition("=")[2] for text in settings or ()}
    given |= {column: names[column].strip() for column in COLUMNS if column in names}  # as it is
    reading = {name: given.pop(name) for name in of_reading if name in given}
    if "missing" in reading:
        missing = reading["missing"]
        listed = missing if isinstance(missing, tuple | list) else [missing]
        reading["missing"] = tuple(map(str, listed))
    return {**given, "scale": scale, "reading": Reading(**reading)}


def read(path: Path, arguments: dict[str, Any], *, repeats: bool = False) -> Log:
    """Read a log, and print how it was read.

    Args:
        path: Path of the file.
        arguments: See `log_arguments`.
        repeats: Whether rows may be the same, whatever the arguments say.

    Raises:
        ValueError: See `roletrust_env.logs.read`.
        OSError: The file cannot be read.
    """
    reading = arguments["reading"]
    log = read_log(
        path, **{**arguments, "reading": replace(reading, repeats=reading.repeats or repeats)}
    )
    for note in log.notes:
        tell(note)
    return log
