"""Options by which commands read a log of ratings."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from roletrust_env.data.columns import Columns
from roletrust_env.data.dialect import Dialect
from roletrust_env.data.log import RatingLog, read_ratings
from roletrust_env.evaluation.specs import parse_settings
from roletrust_experiments.commands.console import tell

MONTH = 2_592_000.0
"""Length of a round, 30 days in seconds."""


_option = partial(typer.Option, rich_help_panel="Reading")


@dataclass(frozen=True)
class LogOptions:
    """Options by which a log is read; the help of each says what it is."""

    rater: Annotated[str, _option(help="Column of the rater: a name, or a number from 1.")] = (
        "rater"
    )
    ratee: Annotated[str, _option(help="Column of the rated agent.")] = "ratee"
    rating: Annotated[str, _option(help="Column of the rating.")] = "rating"
    time: Annotated[
        str | None,
        _option(
            help="Column of the time, numbers or dates; with --every it is looked for.",
            show_default=False,
        ),
    ] = None
    scale: Annotated[
        tuple[float, float] | None,
        _option(
            help="Worst and best rating: 0 and 1, with --compare -10 and 10.", metavar="WORST BEST"
        ),
    ] = None
    every: Annotated[
        float | None,
        _option(
            help=(
                "Length of a round: seconds, or the unit of the time; 30 days in `audit` and with "
                "--compare."
            )
        ),
    ] = None
    same_agents: Annotated[
        bool | None,
        _option(
            "--same-agents/--two-roles",
            help="Whether rater and ratee of one name are one; with --compare, yes.",
        ),
    ] = None
    labels: Annotated[
        str | None, _option(help="Numbers of ratings that are texts, such as yes=1,no=0.")
    ] = None
    missing: Annotated[
        bool, _option("--missing", help="Leave out rows in which a value is missing.")
    ] = False
    repeats: Annotated[
        bool, _option("--repeats", help="Allow rows that repeat an earlier one.")
    ] = False
    tag: Annotated[
        str | None, _option(help="Tag of the feedback events of ERC-8004 that count.")
    ] = None
    separator: Annotated[
        str | None, _option(help="Separator, also comma, tab, semicolon, bar, blanks.")
    ] = None
    encoding: Annotated[str | None, _option(help="Encoding, such as utf-8, utf-16 or latin-1.")] = (
        None
    )
    header: Annotated[
        bool | None, _option(help="Whether the first row has the names of the columns.")
    ] = None
    time_format: Annotated[
        str | None, _option(help="Form of dates, such as %d.%m.%Y, if it is not found.")
    ] = None
    time_unit: Annotated[
        str | None, _option(help="Unit of times that are numbers.", metavar="s|ms|us|ns")
    ] = None

    @property
    def ends(self) -> tuple[float, float]:
        """The worst and the best rating."""
        return self.scale or (0.0, 1.0)

    def read(self, path: Path, advance: Callable[[int], None] = lambda rows: None) -> RatingLog:
        """Read a log, and print how it was read.

        Args:
            path: Path of the file.
            advance: Function that is called with the number of rows read so far.

        Raises:
            ValueError: See `read_ratings`.
            OSError: The file cannot be read.
        """
        return read_ratings(
            path,
            Columns(
                self.rater,
                self.ratee,
                self.rating,
                self.time or (None if self.every is None else "time"),
            ),
            scale=self.ends,
            same_agents=bool(self.same_agents),
            repeats=self.repeats,
            missing=self.missing,
            tag=self.tag,
            labels=parse_settings(self.labels.split(",") if self.labels else (), "--labels"),
            dialect=Dialect(
                self.separator, self.encoding, self.header, self.time_unit, self.time_format
            ),
            every=self.every,
            advance=advance,
            tell=tell,
        )
