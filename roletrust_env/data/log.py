"""A log of ratings from a CSV file, checked row by row."""

import csv
import gzip
import zlib
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from roletrust_env.data.scale import check_scale
from roletrust_env.errors import suggest
from roletrust_env.trust.key_index import Ints
from roletrust_env.trust.ledger import Floats

_ROWS = 50_000  # read at a time


class Columns(NamedTuple):
    """The columns of a file: names in its header, or numbers from 1 if it has none.

    Attributes:
        rater: Column of the rater.
        ratee: Column of the ratee, the provider.
        rating: Column of the rating.
        time: Column of the time; None if there is none.
    """

    rater: str = "rater"
    ratee: str = "ratee"
    rating: str = "rating"
    time: str | None = None


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
    """Read ratings from a CSV file, which may be compressed by gzip (`.gz`).

    Args:
        path: Path of the file, in UTF-8, with commas.
        columns: Columns, all by name if the file has a header, or all by number from 1 if it has none.
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
    read = 0
    try:
        with _opened(path) as file:
            rows = csv.reader(file, strict=True)
            where, first = _places(path, columns, rows)
            while chunk := list(islice(rows, _ROWS)):
                parts.append(_parsed(chunk, where, f"{path}, row", first + read, (raters, ratees), scale))
                read += len(chunk)
                advance(read)
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not text in UTF-8 after row {read}, so it is no CSV file") from None
    except csv.Error as error:
        raise ValueError(f"{path}, after row {read}: {error}; it is no CSV file") from None
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise ValueError(f"{path} is a damaged gzip file, after row {read}: {error}") from None
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


def _opened(path: Path) -> IO[str]:
    """Return an open text file. A byte-order mark is skipped."""
    if path.suffix == ".gz":
        return gzip.open(path, "rt", encoding="utf-8-sig", newline="")
    return path.open(encoding="utf-8-sig", newline="")


def _places(path: Path, columns: Columns, rows: Iterator[list[str]]) -> tuple[list[int], int]:
    """Return the places of the columns, -1 for a missing time, and the number of the first row of ratings."""
    wanted = [name for name in columns if name is not None]
    if all(name.isdecimal() for name in wanted):
        where, first = [int(name) - 1 for name in wanted], 1
        if min(where) < 0:
            raise ValueError("columns are numbered from 1")
    else:
        header = [name.strip() for name in next(rows, [])]
        for name in wanted:
            if name not in header:
                raise ValueError(f"{path}, row 1: there is no column {name!r}{suggest(name, header, 'it has')}")
        where, first = [header.index(name) for name in wanted], 2
    return (where if columns.time is not None else [*where, -1]), first


def _parsed(
    chunk: list[list[str]],
    where: Sequence[int],
    row: str,
    first: int,
    indices: tuple[dict[str, int], dict[str, int]],
    scale: tuple[float, float],
) -> tuple[Ints, Ints, Floats, Floats]:
    """Return the columns of some rows: places of raters and ratees, ratings on [0, 1], and times, 0 without."""
    needed = max(where) + 1
    for n, fields in enumerate(chunk):
        if len(fields) < needed:
            raise ValueError(f"{row} {first + n} has {len(fields)} columns; {needed} are needed")
    rater, ratee, rating, time = where
    people = []
    for place, index in zip((rater, ratee), indices, strict=True):
        names = [fields[place] for fields in chunk]
        if "" in names:
            raise ValueError(f"{row} {first + names.index('')} has no name in column {place + 1}")
        people.append(np.array([index.setdefault(name, len(index)) for name in names], np.int64))
    values = _column([fields[rating] for fields in chunk], "rating", row, first)
    worst, best = scale
    if (off := np.flatnonzero((values < worst) | (values > best))).size:
        at = off[0]
        raise ValueError(f"{row} {first + at}: the rating {values[at]:g} is off the scale from {worst:g} to {best:g}")
    times = np.zeros(len(chunk)) if time < 0 else _times([fields[time] for fields in chunk], row, first)
    return people[0], people[1], (values - worst) / (best - worst), times


def _column(texts: list[str], what: str, row: str, first: int) -> Floats:
    """Return texts as finite numbers."""
    try:
        values = np.array(texts, np.float64)
    except ValueError:
        values = np.array([_number(text) for text in texts])
    if (wrong := np.flatnonzero(~np.isfinite(values))).size:
        raise ValueError(f"{row} {first + wrong[0]}: the {what} is {texts[wrong[0]]!r}; it must be a number")
    return values


def _times(texts: list[str], row: str, first: int) -> Floats:
    """Return times as numbers; dates and times of ISO 8601 become seconds since 1970."""
    if "-" in texts[0][1:] and "e" not in texts[0]:
        try:
            return np.array(texts, "datetime64[s]").astype(np.float64)
        except ValueError:
            pass  # the message below names the row
    return _column(texts, "time", row, first)


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
