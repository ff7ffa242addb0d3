"""A log of ratings, read from a file or a data frame and checked."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.logs.columns import COLUMNS, Column, find_columns
from roletrust_env.logs.evidence import window
from roletrust_env.logs.names import NameList
from roletrust_env.logs.sources import Reading, Source, open_source
from roletrust_env.logs.units import check_scale, number_text, unit_ratings
from roletrust_env.logs.values import (
    Row,
    is_missing,
    name_codes,
    plain_column,
    rating_numbers,
    time_nanoseconds,
)
from roletrust_env.parameters import truth_value
from roletrust_env.trust.key_index import Floats, Ints


class TooSmallError(ValueError):
    """A log is too small for what is measured."""


class Log(NamedTuple):
    """Ratings in the order of their times, or of the source if it has none.

    Attributes:
        raters: Position of each rating's rater among the names, shape (n,).
        ratees: Position of each rating's ratee among the names, shape (n,).
        values: Ratings on [0, 1], shape (n,), 0 for the worst.
        times: Times in nanoseconds, shape (n,), ascending; None if there are none.
        rater_names: Names of the raters; the same object as those of the ratees if members rate
            members.
        ratee_names: Names of the ratees.
        notes: How the source was read, and warnings about it, one line each.
    """

    raters: Ints
    ratees: Ints
    values: Floats
    times: Ints | None
    rater_names: Sequence[str]
    ratee_names: Sequence[str]
    notes: tuple[str, ...] = ()

    @property
    def shape(self) -> tuple[int, int]:
        """The number of raters and of ratees."""
        return len(self.rater_names), len(self.ratee_names)

    @property
    def same_agents(self) -> bool:
        """True if members rate members, so that a rater and a ratee of one name are one agent."""
        return self.rater_names is self.ratee_names


def check_log(log: Any) -> None:
    """Refuse anything but a log.

    Raises:
        TypeError: It is something else, such as a data frame.
    """
    if not isinstance(log, Log):
        raise TypeError(f"the log is a {type(log).__name__}; it must be a Log, which read returns")


def read(
    source: Any,
    *,
    rater: str | None = None,
    ratee: str | None = None,
    rating: str | None = None,
    time: str | None = None,
    scale: tuple[float, float] = (0.0, 1.0),
    same_agents: bool = False,
    reading: Reading = Reading(),  # noqa: B008 - immutable
) -> Log:
    """Return the ratings in a file or a data frame.

    Files are CSV, JSON (an object in each line, or an array), Parquet (also a folder), Feather,
    SQLite and xlsx; texts may be packed (`.gz`, `.xz`, `.bz2`, `.zip`). A column that is not named
    is found if just one has a usual name, such as `user_id`; a column of times is optional. Names
    count without white space at their ends and in composed form (NFC). Numbers of seconds count to
    the microsecond, and dates to the nanosecond.

    Args:
        source: Path, a data frame with Arrow's C stream interface (pandas, polars, DuckDB, Arrow),
            or a mapping of columns.
        rater: Name of the column of the rater.
        ratee: Name of the column of the rated agent.
        rating: Name of the column of the rating.
        time: Name of the column of the time.
        scale: Worst and best rating.
        same_agents: Whether a rater and a ratee of the same name are one agent.
        reading: What is known about the source, such as its separator.

    Raises:
        ValueError: The source is not such a table, a column is missing or ambiguous, or a row is
            not allowed. The message names the source and the row.
        OSError: The file cannot be read.

    Example:
        >>> log = read({"user": ["ann", "bob"], "item": ["shop", "shop"], "stars": [5, 3]},
        ...            scale=(1, 5))
        >>> log.values.tolist()
        [1.0, 0.5]
    """
    check_scale(scale)
    same_agents = truth_value("same_agents", same_agents)
    opened = open_source(source, reading)
    found = find_columns(opened, {"rater": rater, "ratee": ratee, "rating": rating, "time": time})
    try:
        return _checked(opened, found, scale, same_agents=same_agents, reading=reading)
    except _arrow_error() as error:
        raise ValueError(f"{opened.name} has a damaged column: {error}") from None


def _arrow_error() -> type[Exception]:
    """Return the base of pyarrow's errors."""
    import pyarrow as arrow

    error: type[Exception] = arrow.ArrowException
    return error


def _checked(
    opened: Source,
    found: Mapping[Column, int],
    scale: tuple[float, float],
    *,
    same_agents: bool,
    reading: Reading,
) -> Log:
    """Return the ratings of a table, see `read`."""
    columns: dict[Any, Any] = {
        column: plain_column(opened.table.column(found[column]))
        for column in COLUMNS
        if column in found
    }
    kept, notes = _without_missing(columns, reading)
    row = _row_after(opened, kept)
    if not len(columns["rating"]):
        raise ValueError(f"{opened.name} has no ratings")
    people = [columns["rater"], columns["ratee"]]
    if same_agents:
        names, (who, whom) = name_codes(people, ["rater", "ratee"], row)
        raters = ratees = NameList(names)
    else:
        (names, (who,)), (others, (whom,)) = (
            name_codes([column], [what], row)
            for column, what in zip(people, ("rater", "ratee"), strict=True)
        )
        raters, ratees = NameList(names), NameList(others)
    values = _on_scale(rating_numbers(columns["rating"], reading, row), scale, row)
    if same_agents and (own := who == whom).any():
        at = int(own.argmax())
        raise ValueError(f"{row(at)}: {raters[int(who[at])]!r} rates itself")
    named = ", ".join(
        f"{column} = {opened.table.column_names[found[column]]}" for column in columns
    )
    if "time" in columns:
        times = time_nanoseconds(columns["time"], reading, row)
        order = None
        if (times[1:] < times[:-1]).any():
            order = np.argsort(times, kind="stable")
            who, whom, values, times = who[order], whom[order], values[order], times[order]
            notes.append("Sorted by time.")
        log = Log(who, whom, values, times, raters, ratees)
        if not reading.repeats:
            _refuse_repeats(log, times, order, row)
    else:
        log = Log(who, whom, values, None, raters, ratees)
    if log.times is not None:
        named += ", from {since} to {until}".format(**window(log.times))
    return log._replace(notes=(f"Read as {opened.about}: {named}.", *notes, *_warnings(log)))


def _without_missing(columns: dict[Any, Any], reading: Reading) -> tuple[Ints | None, list[str]]:
    """Leave out rows with a missing value, if texts for one are stated.

    Returns:
        The positions of the rows that are kept, None for all; and notes.
    """
    if not reading.missing:
        return None, []
    gone = np.logical_or.reduce(
        [is_missing(column, reading.missing) for column in columns.values()]
    )
    if not gone.any():
        return None, []
    for name, column in columns.items():
        columns[name] = column.filter(~gone)
    return np.flatnonzero(~gone), [f"{gone.sum():,} rows with a missing value are left out."]


def _row_after(source: Source, kept: Ints | None) -> Row:
    """Return a function from a position among the kept rows to the source and the row."""
    return lambda at: source.row(at if kept is None else int(kept[at]))


def _on_scale(ratings: Floats, scale: tuple[float, float], row: Row) -> Floats:
    try:
        return unit_ratings(ratings, scale, lambda at: f"{row(at)}: the rating is")
    except ValueError as error:
        ends = f"{number_text(ratings.min())} to {number_text(ratings.max())}"
        raise ValueError(f"{error}; all ratings here are from {ends}") from None


def _refuse_repeats(log: Log, times: Ints, order: Ints | None, row: Row) -> None:
    """Refuse a row that is the same as an earlier one in all columns."""
    equal = times[1:] == times[:-1]
    near = np.flatnonzero(np.append(equal, False) | np.append(False, equal))
    columns = [column[near] for column in (log.values, log.ratees, log.raters, times)]
    by_value = np.lexsort(columns)
    same = np.logical_and.reduce([np.diff(column[by_value]) == 0 for column in columns])
    if not same.any():
        return
    at = int(same.argmax())
    places = near[by_value[at : at + 2]]
    first, again = sorted((places if order is None else order[places]).tolist())
    raise ValueError(
        f"{row(again)} repeats row {row(first).rpartition(' ')[2]}: rater, ratee, rating and time "
        "are the same; repeats=true allows it"
    )


def _warnings(log: Log) -> list[str]:
    """Return what may be wrong with a log."""
    found = list[str]()
    if len(log.values) < 2:
        return found
    if (log.values == log.values[0]).all():
        found.append(f"Warning: all {len(log.values):,} ratings are the same.")
    if (log.raters == log.raters[0]).all():
        found.append(f"Warning: all {len(log.values):,} ratings are by one rater.")
    return found
