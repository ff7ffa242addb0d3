"""A log of ratings from a CSV or Parquet file, checked row by row."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.data.dates import has_zone, is_date, text_seconds
from roletrust_env.data.scale import check_scale
from roletrust_env.data.tables import Block, Columns, Texts, first_row, read_blocks
from roletrust_env.trust.key_index import Ints
from roletrust_env.trust.ledger import Floats


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
    """

    raters: Ints
    ratees: Ints
    values: Floats
    times: Floats | None
    rater_names: list[str]
    ratee_names: list[str]
    was_sorted: bool

    @property
    def shape(self) -> tuple[int, int]:
        """The number of raters and of ratees."""
        return len(self.rater_names), len(self.ratee_names)


def read_ratings(
    path: Path,
    columns: Columns = Columns(),  # noqa: B008 - immutable
    *,
    scale: tuple[float, float] = (0.0, 1.0),
    same_agents: bool = False,
    repeats: bool = False,
    advance: Callable[[int], None] = lambda rows: None,
) -> RatingLog:
    """Read ratings from a CSV file, which may be compressed by gzip (`.gz`), or from a Parquet file (`.parquet`).

    Parquet needs pyarrow, the extra `parquet`. Its rows count from 1, and those of a CSV file with its header.

    Args:
        path: Path of the file; CSV is in UTF-8, with commas.
        columns: Columns, all by name, or all by number from 1, as in a CSV file without header.
        scale: Worst and best rating.
        same_agents: Whether a rater and a ratee of the same name are one agent.
        repeats: Whether rows may repeat an earlier one, with the same rater, ratee, rating and time.
        advance: Function that is called with the number of rows read so far.

    Raises:
        ValueError: The file is no such table, or a row is not allowed. The message names the file and the row.
        OSError: The file cannot be read.
    """
    check_scale(scale)
    raters: dict[str, int] = {}
    ratees = raters if same_agents else {}
    parts: list[tuple[Ints, Ints, Floats, Floats]] = []
    read, first, zoned = 0, first_row(path, columns), None
    for block in read_blocks(path, columns):
        if not read and isinstance(block.times, list) and is_date(block.times[0]):
            zoned = has_zone(block.times[0])
        parts.append(_parsed(block, f"{path}, row", first + read, columns, (raters, ratees), scale, zoned))
        read += len(block.raters)
        advance(read)
    if not read:
        raise ValueError(f"{path} has no ratings")
    who, whom, values, times = (np.concatenate(column) for column in zip(*parts, strict=True))
    if same_agents:
        _refuse(who == whom, path, first, lambda at: f"{list(raters)[who[at]]!r} rates itself")
    if not repeats and columns.time is not None:
        _refuse_repeats(path, first, (who, whom, values, times))
    order, was_sorted = slice(None), bool((np.diff(times) >= 0).all())
    if not was_sorted:
        order = np.argsort(times, kind="stable")  # type: ignore[assignment]
    names = list(raters), list(ratees)
    stamps = None if columns.time is None else times[order]
    return RatingLog(who[order], whom[order], values[order], stamps, *names, was_sorted)


def _parsed(
    block: Block,
    row: str,
    first: int,
    columns: Columns,
    indices: tuple[dict[str, int], dict[str, int]],
    scale: tuple[float, float],
    zoned: bool | None,
) -> tuple[Ints, Ints, Floats, Floats]:
    """Return the columns of some rows: places of raters and ratees, ratings on [0, 1], and times, 0 without.

    Times are all dates, all with a time zone or all without (`zoned`), or all numbers (None).
    """
    people = []
    for names, index, column in zip((block.raters, block.ratees), indices, columns[:2], strict=True):
        if "" in names:
            raise ValueError(f"{row} {first + names.index('')} has no name in column {column!r}")
        people.append(np.array([index.setdefault(name, len(index)) for name in names], np.int64))
    what = "the rating" if columns.by_number or columns.rating == Columns().rating else f"column {columns.rating!r}"
    values = _column(block.ratings, what, row, first)
    worst, best = scale
    if (off := np.flatnonzero((values < worst) | (values > best))).size:
        at = off[0]
        raise ValueError(f"{row} {first + at}: the rating {values[at]:g} is off the scale from {worst:g} to {best:g}")
    if block.times is None:
        times = np.zeros(len(values))
    elif zoned is None:
        times = _column(block.times, "the time", row, first)
    else:
        times = text_seconds(block.times, "the time", row, first, zoned=zoned)  # type: ignore[arg-type]
    return people[0], people[1], (values - worst) / (best - worst), times


def _column(texts: Texts, what: str, row: str, first: int) -> Floats:
    """Return a column as finite numbers."""
    try:
        values = np.asarray(texts, np.float64)
    except ValueError:
        values = np.array([_number(str(text)) for text in texts])
    if (wrong := np.flatnonzero(~np.isfinite(values))).size:
        raise ValueError(f"{row} {first + wrong[0]}: {what} is {str(texts[wrong[0]])!r}; it must be a number")
    return values


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _refuse(wrong: Any, path: Path, first: int, reason: Callable[[int], str]) -> None:
    """Refuse the first row that is wrong."""
    if (found := np.flatnonzero(wrong)).size:
        raise ValueError(f"{path}, row {first + int(found[0])}: {reason(int(found[0]))}")


def _refuse_repeats(path: Path, first: int, columns: tuple[Ints, Ints, Floats, Floats]) -> None:
    """Refuse a row that is the same as an earlier one in all columns."""
    order = np.lexsort(columns)
    same = np.logical_and.reduce([np.diff(column[order]) == 0 for column in columns])
    if (at := np.flatnonzero(same)).size:
        later = at[np.argmin(order[at + 1])]
        raise ValueError(
            f"{path}, row {first + int(order[later + 1])} repeats row {first + int(order[later])}: rater, ratee, "
            "rating and time are the same; allow repeats to count them as one"
        )
