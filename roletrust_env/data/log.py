"""A log of ratings from a file, read by pyarrow and checked row by row."""

from collections.abc import Callable, Iterator, Mapping
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.data.columns import Columns, by_number
from roletrust_env.data.dialect import Dialect
from roletrust_env.data.rounds import MOST, round_numbers
from roletrust_env.data.tables import Table
from roletrust_env.data.units import check_scale, unit_ratings
from roletrust_env.data.values import Clock, Times, coded, numbers, places
from roletrust_env.trust.key_index import Floats, Ints

_FACTOR, _HALF = np.uint64(0x9E3779B97F4A7C15), np.uint64(32)
_FEW, _SHARE = 100, 0.9  # more empty rounds, and a larger share of them, are told
_YEAR, _FIRST, _LAST = 31_556_952, 1971, 2200  # seconds; years before and after which times are doubted


class RatingLog(NamedTuple):
    """Ratings in the order of their times, or of the file if it has none.

    Attributes:
        raters: Place of each rating's rater among the names, shape (n,).
        ratees: Place of each rating's ratee among the names, shape (n,).
        values: Ratings on [0, 1], shape (n,), 0 for the worst.
        times: Times, shape (n,), ascending; None if there are none.
        rater_names: Names of the raters; the same list as that of the ratees if members rate members.
        ratee_names: Names of the ratees.
        was_sorted: Whether the file was in the order of time.
        clock: Kind of its times, see `Clock.kind`; empty without times.
    """

    raters: Ints
    ratees: Ints
    values: Floats
    times: Floats | None
    rater_names: list[str]
    ratee_names: list[str]
    was_sorted: bool
    clock: str = ""

    @property
    def shape(self) -> tuple[int, int]:
        """The number of raters and of ratees."""
        return len(self.rater_names), len(self.ratee_names)

    @property
    def same_agents(self) -> bool:
        """Whether members rate members, so that a rater and a ratee of one name are one agent."""
        return self.rater_names is self.ratee_names


def read_ratings(
    path: Path,
    columns: Columns = Columns(),  # noqa: B008 - immutable
    *,
    scale: tuple[float, float] = (0.0, 1.0),
    same_agents: bool = False,
    repeats: bool = False,
    missing: bool = False,
    tag: str | None = None,
    labels: Mapping[str, float] | None = None,
    dialect: Dialect = Dialect(),  # noqa: B008 - immutable
    every: float | None = None,
    advance: Callable[[int], None] = lambda rows: None,
    tell: Callable[[str], None] = lambda line: None,
) -> RatingLog:
    """Read ratings from CSV in any dialect, JSON (`.json`, `.jsonl`, `.ndjson`) or Parquet (`.parquet`, `.pq`).

    JSON has an object in each line, or all in an array. Each may be compressed by gzip (`.gz`). The dialect of a text
    is found from its beginning, and so are columns with common names. Feedback events of ERC-8004 become ratings, see
    `as_ratings`. Blank rows and lines of comment (`#`, `%`) are left out. Rows count from 1, in a text with its header;
    a text in quotes that has several lines is in one row. Names count as `roletrust_env.data.values.trimmed` returns
    them, and without `.0` if all are whole numbers.

    Args:
        path: Path of the file.
        columns: Columns, by name or by number from 1.
        scale: Worst and best rating.
        same_agents: Whether a rater and a ratee of the same name are one agent.
        repeats: Whether rows may repeat an earlier one, with the same rater, ratee, rating and time.
        missing: Whether rows are left out in which a rater, ratee, rating or time is missing: blank, or `NA` and the
            like for numbers.
        tag: Tag of the feedback events of ERC-8004 that count; None for all.
        labels: Numbers of ratings that are texts, such as `{"yes": 1, "no": 0}`; upper case does not matter.
        dialect: Parts of the dialect that are known.
        every: Length of a round, by which it may be told that most are empty.
        advance: Function that is called with the number of rows read so far.
        tell: Function that is called with lines for the user: how the file was read, and what may be wrong with it.

    Raises:
        ValueError: The file is no such table, or a row is not allowed. The message names the file and the row. Or
            pyarrow is missing.
        OSError: The file cannot be read.
    """
    check_scale(scale)
    known = {str(text).strip().casefold(): value for text, value in (labels or {}).items()}
    if wrong := [text for text, value in known.items() if not isinstance(value, Real) or not np.isfinite(float(value))]:
        raise ValueError(f"the rating of {wrong[0]!r} is {known[wrong[0]]!r}; it must be a number")
    table = Table(path, columns.wanted, dialect, known, missing=missing, tag=tag)
    people, values, times = (
        list[Any](),
        list[Floats](),
        Times(dialect.unit, dialect.time_format),
    )  # raters and ratees take turns
    read = 0
    plain = by_number(columns.wanted) or columns.rating == Columns().rating
    what = "the rating" if plain else f"column {columns.rating!r}"
    for block in table.blocks():
        row = _row_after(table, read)
        people += [coded(block[side], f"column {columns[side]!r}", row) for side in (0, 1)]
        values.append(numbers(block[2], what, row, comma=table.decimal_comma, labels=known))
        if columns.time is not None:
            times.add(block[3], row, comma=table.decimal_comma)
        read += len(block[2])
        advance(read)
    if not read:
        raise ValueError(f"{path} has no ratings")
    if same_agents:
        raters, (who, whom), joined, floats = places(people, 2)
        ratees = raters
    else:
        (raters, (who,), joined, floats), (ratees, (whom,), *more) = places(people[::2], 1), places(people[1::2], 1)
        joined, floats = joined + more[0], floats + more[1]
    ratings = np.concatenate(values)
    try:
        unit = unit_ratings(ratings, scale, lambda at: f"{table.row(at)}: the rating is")
    except ValueError as error:
        ends = f"{ratings.min():g} {ratings.max():g}"
        raise ValueError(f"{error}; all ratings here are on --scale {ends}, from worst to best") from None
    if same_agents and (own := np.flatnonzero(who == whom)).size:
        raise ValueError(f"{table.row(int(own[0]))}: {raters[who[own[0]]]!r} rates itself")
    clock = None if columns.time is None else times.clock()
    if clock is not None and not repeats:
        _refuse_repeats(table, (who, whom, unit, clock.exact))
    log = RatingLog(who, whom, unit, clock and clock.seconds, raters, ratees, True, clock.kind if clock else "")
    if clock is not None and not (np.diff(clock.exact) >= 0).all():
        order = np.argsort(clock.exact, kind="stable")
        log = log._replace(raters=who[order], ratees=whom[order], values=unit[order], times=clock.seconds[order])
        log = log._replace(was_sorted=False)
    for line in _lines(table, joined, floats, log, clock, every):
        tell(line)
    return log


def _row_after(table: Table, read: int) -> Callable[[int], str]:
    """Return a function from a place in the next block to the path and the row."""
    return lambda at: table.row(read + int(at))


def _lines(
    table: Table, joined: int, floats: int, log: RatingLog, clock: Clock | None, every: float | None
) -> Iterator[str]:
    """Yield how a file was read, and warnings with their numbers."""
    parts = [*table.found, *([f"times are {clock.words}"] if clock else []), *["sorted by time"][log.was_sorted :]]
    counts = {
        "blank rows": table.blank,
        "lines of comment": table.comments,
        "rows with a missing value left out": table.incomplete,
        "names joined with another, from which white space at the ends or the form of Unicode told them": joined,
        "names of whole numbers without their .0": floats,
    }
    yield f"Read as {', '.join([*parts, *(f'{what}: {count:,}' for what, count in counts.items() if count)])}."
    many = f"Warning: all {len(log.values):,} ratings are"
    if (log.values == log.values[0]).all():
        yield f"{many} the same."
    if (log.raters == log.raters[0]).all():
        yield f"{many} by one rater, {log.rater_names[log.raters[0]]}."
    if clock is None or log.times is None:
        return
    if clock.words != "numbers":
        first, last = (1970 + int(time // _YEAR) for time in (log.times[0], log.times[-1]))
        if first < _FIRST or last > _LAST:
            yield f"Warning: times are from the year {first} to {last}; their unit may be another (--time-unit)."
    if every is not None and log.times[-1] - log.times[0] < every * MOST:
        rounds = round_numbers(log.times, every, float(log.times[0]))
        total, full = int(rounds[-1]) + 1, len(np.unique(rounds))
        if total - full > max(_FEW, _SHARE * total):
            yield f"Warning: {total - full:,} of {total:,} rounds are empty; --every is {every:g}, in another unit?"
        if total == 1 and log.times[0] < log.times[-1]:
            yield f"{many} in one round; --every is {every:g}, in another unit?"


def _refuse_repeats(table: Table, columns: tuple[Ints, Ints, Floats, Ints | Floats]) -> None:
    """Refuse a row that is the same as an earlier one in all columns."""
    digest = np.zeros(len(columns[0]), np.uint64)
    for column in columns:
        digest = (digest + (column + 0).view(np.uint64)) * _FACTOR  # + 0, since -0.0 is 0.0
        digest ^= digest >> _HALF
    digest.sort()
    if (digest[1:] != digest[:-1]).all():  # sorting all columns would take ten times as long
        return
    order = np.lexsort(columns)
    same = np.logical_and.reduce([np.diff(column[order]) == 0 for column in columns])
    if (at := np.flatnonzero(same)).size:
        later = at[np.argmin(order[at + 1])]
        raise ValueError(
            f"{table.row(int(order[later + 1]))} repeats {table.row(int(order[later])).rpartition(', ')[2]}: rater, "
            "ratee, rating and time are the same; --repeats counts them as one"
        )
