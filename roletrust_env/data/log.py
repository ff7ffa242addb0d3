"""A log of ratings from a file, read by pyarrow and checked row by row."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from numbers import Real
from pathlib import Path
from typing import NamedTuple

import numpy as np

from roletrust_env.data.columns import Columns, by_number
from roletrust_env.data.dialect import Dialect
from roletrust_env.data.names import JOINED, NameColumns
from roletrust_env.data.rounds import MOST, round_numbers
from roletrust_env.data.tables import Block, Table
from roletrust_env.data.units import check_scale, number_text, unit_ratings
from roletrust_env.data.values import Clock, Row, Times, named, numbers
from roletrust_env.parameters import truth_value
from roletrust_env.trust.edges import pair_keys
from roletrust_env.trust.key_index import Floats, Ints, KeyIndex

_FACTOR, _HALF = np.uint64(0x9E3779B97F4A7C15), np.uint64(32)
_FEW, _SHARE = 100, 0.9  # more empty rounds, and a larger share of them, are told
_YEAR, _FIRST, _LAST = (
    31_556_952,
    1971,
    2200,
)  # seconds; years before and after which times are doubted


class Pairs(NamedTuple):
    """The pairs of rater and ratee in a log.

    Attributes:
        numbers: Number of each rating's pair: the place of the pair's first rating, shape (n,).
        repeated: Pairs with several ratings, see `pair_keys`, ascending, shape (k,).
        counts: Number of the ratings of each of these, shape (k,).
    """

    numbers: Ints
    repeated: Ints
    counts: Ints


class RatingLog(NamedTuple):
    """Ratings in the order of their times, or of the file if it has none.

    Attributes:
        raters: Place of each rating's rater among the names, shape (n,).
        ratees: Place of each rating's ratee among the names, shape (n,).
        values: Ratings on [0, 1], shape (n,), 0 for the worst.
        times: Times, shape (n,), ascending; None if there are none.
        rater_names: Names of the raters; the same object as those of the ratees if members rate
            members.
        ratee_names: Names of the ratees.
        was_sorted: Whether the file was in the order of time.
        clock: Kind of its times, see `Clock.kind`; empty without times.
        rests: What `times` do not hold of the times, for `TrustStream.update`; None if that is
            nothing.
    """

    raters: Ints
    ratees: Ints
    values: Floats
    times: Floats | None
    rater_names: Sequence[str]
    ratee_names: Sequence[str]
    was_sorted: bool
    clock: str = ""
    rests: Floats | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """The number of raters and of ratees."""
        return len(self.rater_names), len(self.ratee_names)

    @property
    def same_agents(self) -> bool:
        """True if members rate members, so that a rater and a ratee of one name are one agent."""
        return self.rater_names is self.ratee_names

    def pairs(self) -> Pairs:
        """Return the pairs of rater and ratee."""
        keys = pair_keys(self.raters, self.ratees)
        ordered = np.sort(keys)
        repeated, counts = np.unique(ordered[1:][ordered[1:] == ordered[:-1]], return_counts=True)
        places = KeyIndex.of(repeated).places(keys, add=False)
        again = np.flatnonzero(places >= 0)
        places, first = places[again], np.empty(len(repeated), np.int64)
        first[places[::-1]] = again[::-1]  # the last assignment stays
        numbers = np.arange(len(keys))
        numbers[again] = first[places]
        return Pairs(numbers, repeated, counts + 1)


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
    """Read ratings from CSV in any dialect, JSON (`.json`, `.jsonl`, `.ndjson`) or Parquet
    (`.parquet`, `.pq`).

    JSON has an object in each line, or all in an array. Each may be compressed by gzip (`.gz`). The
    dialect of a text is found from its beginning, and so are columns with common names. Feedback
    events of ERC-8004 become ratings, see `as_ratings`. Blank rows and lines of comment (`#`, `%`)
    are left out. Rows count from 1, in a text with its header; a text in quotes that has several
    lines is in one row. Names count as `roletrust_env.data.values.trimmed` returns them, and
    without `.0` if all are whole numbers.

    Args:
        path: Path of the file.
        columns: Columns, by name or by number from 1.
        scale: Worst and best rating.
        same_agents: Whether a rater and a ratee of the same name are one agent.
        repeats: Whether rows may repeat an earlier one, with the same rater, ratee, rating and
            time.
        missing: Whether rows are left out in which a rater, ratee, rating or time is missing:
            blank, or `NA` and the like for numbers.
        tag: Tag of the feedback events of ERC-8004 that count; None for all.
        labels: Numbers of ratings that are texts, such as `{"yes": 1, "no": 0}`; upper case does
            not matter.
        dialect: Parts of the dialect that are known.
        every: Length of a round, by which it may be told that most are empty.
        advance: Function that is called with the number of rows read so far.
        tell: Function that is called with lines for the user: how the file was read, and what may
            be wrong with it.

    Raises:
        ValueError: The file is no such table, or a row is not allowed. The message names the file
            and the row. Or pyarrow is missing.
        OSError: The file cannot be read.
    """
    check_scale(scale)
    same_agents, repeats = truth_value("same_agents", same_agents), truth_value("repeats", repeats)
    missing = truth_value("missing", missing)
    known = {str(text).strip().casefold(): value for text, value in (labels or {}).items()}
    if wrong := [
        text
        for text, value in known.items()
        if not isinstance(value, Real) or not np.isfinite(float(value))
    ]:
        raise ValueError(f"the rating of {wrong[0]!r} is {known[wrong[0]]!r}; it must be a number")
    table = Table(path, columns.wanted, dialect, known, missing=missing, tag=tag)
    values, times, read = list[Floats](), Times(dialect.unit, dialect.time_format), 0
    groups = (
        [(NameColumns(), (0, 1))] if same_agents else [(NameColumns(), (0,)), (NameColumns(), (1,))]
    )
    plain = by_number(columns.wanted) or columns.rating == Columns().rating
    what = "the rating" if plain else f"column {columns.rating!r}"
    with ThreadPoolExecutor(len(groups)) as pool:
        for block in table.blocks():
            row = _row_after(table, read)

            def add(
                group: tuple[NameColumns, tuple[int, ...]], block: Block = block, row: Row = row
            ) -> None:
                group[0].add(
                    *(named(block[side], f"column {columns[side]!r}", row) for side in group[1])
                )

            list(pool.map(add, groups))
            values.append(numbers(block[2], what, row, comma=table.decimal_comma, labels=known))
            if columns.time is not None:
                times.add(block[3], row, comma=table.decimal_comma)
            read += len(block[2])
            advance(read)
        if not read:
            raise ValueError(f"{path} has no ratings")
        found = list(pool.map(lambda group: group[0].places(len(group[1])), groups))
    raters, ratees = found[0][0], found[-1][0]
    who, whom = (places for _, sides, *_ in found for places in sides)
    joined, floats = (sum(one[at] for one in found) for at in (2, 3))
    ratings = np.concatenate(values)
    values.clear()
    try:
        unit = unit_ratings(ratings, scale, lambda at: f"{table.row(at)}: the rating is")
    except ValueError as error:
        ends = f"{number_text(ratings.min())} {number_text(ratings.max())}"
        raise ValueError(
            f"{error}; all ratings here are on --scale {ends}, from worst to best"
        ) from None
    if same_agents and (own := np.flatnonzero(who == whom)).size:
        raise ValueError(f"{table.row(int(own[0]))}: {raters[who[own[0]]]!r} rates itself")
    log, clock = RatingLog(who, whom, unit, None, raters, ratees, was_sorted=True), None
    if columns.time is not None:
        clock = times.clock()
        exact, order = clock.exact, None
        log = log._replace(times=clock.seconds, clock=clock.kind, rests=clock.rests)
        if (exact[1:] < exact[:-1]).any():
            order = np.argsort(exact, kind="stable")
            exact, log = (
                exact[order],
                log._replace(raters=who[order], ratees=whom[order], values=unit[order]),
            )
            rests = None if clock.rests is None else clock.rests[order]
            log = log._replace(times=clock.seconds[order], rests=rests, was_sorted=False)
        if not repeats:
            _refuse_repeats(table, log, exact, order)
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
    parts = [
        *table.found,
        *([f"times are {clock.words}"] if clock else []),
        *["sorted by time"][log.was_sorted :],
    ]
    counts = {
        "blank rows": table.blank,
        "lines of comment": table.comments,
        "rows with a missing value left out": table.incomplete,
        JOINED: joined,
        "names of whole numbers without their .0": floats,
    }
    yield f"Read as {', '.join([*parts, *(f'{what}: {count:,}' for what, count in counts.items() if count)])}."  # noqa: E501
    many = f"Warning: all {len(log.values):,} ratings are"
    if (log.values == log.values[0]).all():
        yield f"{many} the same."
    if (log.raters == log.raters[0]).all():
        yield f"{many} by one rater, {log.rater_names[log.raters[0]]}."
    if clock is None or log.times is None:
        return
    if clock.words != "numbers":
        first, last = (1970 + time // _YEAR for time in (log.times[0], log.times[-1]))
        if first < _FIRST or last > _LAST:
            yield f"Warning: times are from the year {first:.6g} to {last:.6g}; another unit (--time-unit)?"  # noqa: E501
    elif _are_days(log.times):
        yield f"Warning: times such as {log.times[0]:.0f} may be dates; --time-format %Y%m%d reads them as dates."  # noqa: E501
    if every is not None and log.times[-1] - log.times[0] < every * MOST:
        rounds = round_numbers(log.times, every, float(log.times[0]))
        total, full = int(rounds[-1]) + 1, 1 + np.count_nonzero(rounds[1:] != rounds[:-1])
        if total - full > max(_FEW, _SHARE * total):
            yield f"Warning: {total - full:,} of {total:,} rounds are empty; --every is {every:g}, in another unit?"  # noqa: E501
        if total == 1 and log.times[0] < log.times[-1]:
            yield f"{many} in one round; --every is {every:g}, in another unit?"


def _are_days(times: Floats) -> bool:
    """Return whether all times may be dates that are written as whole numbers, such as 20240131."""
    year, rest = np.divmod(times, 10_000)
    month, day = np.divmod(rest, 100)
    fits = (
        (year >= 1900) & (year <= _LAST) & (month >= 1) & (month <= 12) & (day >= 1) & (day <= 31)
    )
    return bool((fits & (times == np.rint(times))).all())


def _refuse_repeats(table: Table, log: RatingLog, times: Ints | Floats, order: Ints | None) -> None:
    """Refuse a row that is the same as an earlier one in all columns.

    Args:
        table: File.
        log: Its rows in the order of time.
        times: Exact times, ascending.
        order: Place of each row in the file; None if they are in its order.
    """
    equal = times[1:] == times[:-1]
    near = np.flatnonzero(np.append(equal, False) | np.append(False, equal))
    columns = [column[near] for column in (log.raters, log.ratees, log.values, times)]
    digest = np.zeros(len(near), np.uint64)
    for column in columns:
        digest = (digest + (column + 0).view(np.uint64)) * _FACTOR  # + 0, since -0.0 is 0.0
        digest ^= digest >> _HALF
    digest.sort()
    if (digest[1:] != digest[:-1]).all():  # sorting all columns would take ten times as long
        return
    places = near if order is None else order[near]
    by_value = np.lexsort([places, *columns])
    same = np.logical_and.reduce([np.diff(column[by_value]) == 0 for column in columns])
    if (at := np.flatnonzero(same)).size:
        later = at[np.argmin(places[by_value[at + 1]])]
        first, again = (table.row(int(places[by_value[place]])) for place in (later, later + 1))
        raise ValueError(
            f"{again} repeats {first.rpartition(', ')[2]}: rater, ratee, rating and time are the "
            "same; "
            "--repeats counts them as one"
        )
