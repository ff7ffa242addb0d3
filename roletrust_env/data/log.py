"""A log of ratings from a CSV or Parquet file, read by pyarrow and checked row by row."""

import codecs
import csv
import gzip
import re
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from roletrust_env.data.units import check_scale, date_seconds, has_zone, is_date, text_seconds, unit_ratings
from roletrust_env.errors import suggest
from roletrust_env.trust.key_index import Floats, Ints

PARQUET = ".parquet"
"""Ending of the name of a Parquet file; any other file is CSV."""

ENDINGS = (".csv", ".csv.gz", PARQUET)
"""Endings of the names of tables in a folder."""

_FACTOR, _HALF = np.uint64(0x9E3779B97F4A7C15), np.uint64(32)
_ROWS = 50_000  # in a block
_BYTES = 1 << 23  # of a CSV file that are parsed at a time


class Columns(NamedTuple):
    """The columns of a file: names, or numbers from 1. A CSV file without header has numbers only.

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

    @property
    def wanted(self) -> list[str]:
        """The columns that are read."""
        return [name for name in self if name is not None]

    @property
    def by_number(self) -> bool:
        """Whether the columns are numbers from 1."""
        return all(name.isdecimal() for name in self.wanted)


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

    The rows of a Parquet file count from 1, and those of a CSV file with its header.

    Args:
        path: Path of the file; CSV is in UTF-8, with commas.
        columns: Columns, all by name, or all by number from 1, as in a CSV file without header.
        scale: Worst and best rating.
        same_agents: Whether a rater and a ratee of the same name are one agent.
        repeats: Whether rows may repeat an earlier one, with the same rater, ratee, rating and time.
        advance: Function that is called with the number of rows read so far.

    Raises:
        ValueError: The file is no such table, or a row is not allowed. The message names the file and the row. Or
            pyarrow is missing.
        OSError: The file cannot be read.
    """
    check_scale(scale)
    people, parts = list[Any](), list[tuple[Floats, Floats]]()  # raters and ratees take turns
    read, first, zoned = 0, first_row(path, columns), None
    row = f"{path}, row"
    for block in _read_blocks(path, columns):
        ratings, stamps = block[2], block[3:]
        if not read and stamps and _is_text(stamps[0]) and is_date(start := _text(stamps[0], 0)):
            zoned = has_zone(start)
        people += [_coded(block[side], f"column {columns[side]!r}", row, first + read) for side in (0, 1)]
        what = "the rating" if columns.by_number or columns.rating == Columns().rating else f"column {columns.rating!r}"
        numbers = _numbers(ratings, what, row, first + read)
        values = unit_ratings(numbers, scale, _rating_in(row, first + read))
        if not stamps:
            times = np.zeros(len(values))
        elif zoned is None:
            times = _numbers(stamps[0], "the time", row, first + read)
        else:
            times = text_seconds([text or "" for text in stamps[0].to_pylist()], row, first + read, zoned=zoned)
        parts.append((values, times))
        read += len(values)
        advance(read)
    if not read:
        raise ValueError(f"{path} has no ratings")
    if same_agents:
        raters, (who, whom) = _places(people, 2)
        ratees = raters
    else:
        (raters, (who,)), (ratees, (whom,)) = _places(people[::2], 1), _places(people[1::2], 1)
    values, times = (np.concatenate(column) for column in zip(*parts, strict=True))
    if same_agents and (own := np.flatnonzero(who == whom)).size:
        raise ValueError(f"{row} {first + own[0]}: {raters[who[own[0]]]!r} rates itself")
    if not repeats and columns.time is not None:
        _refuse_repeats(row, first, (who, whom, values, times))
    order, was_sorted = slice(None), bool((np.diff(times) >= 0).all())
    if not was_sorted:
        order = np.argsort(times, kind="stable")  # type: ignore[assignment]
    ordered = None if columns.time is None else times[order]
    return RatingLog(who[order], whom[order], values[order], ordered, raters, ratees, was_sorted)


def _rating_in(row: str, first: int) -> Callable[[int], str]:
    """Return a function from a place in a block to the beginning of a message about its rating."""
    return lambda at: f"{row} {first + at}: the rating is"


def first_row(path: Path, columns: Columns) -> int:
    """Return the number of the first row with ratings in messages: 2 below the header of a CSV file, else 1."""
    return 1 if path.suffix == PARQUET or columns.by_number else 2


def _refuse_repeats(row: str, first: int, columns: tuple[Ints, Ints, Floats, Floats]) -> None:
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
            f"{row} {first + int(order[later + 1])} repeats row {first + int(order[later])}: rater, ratee, "
            "rating and time are the same; allow repeats to count them as one"
        )


# --- columns of pyarrow -------------------------------------------------------------------------------


def _coded(column: Any, what: str, row: str, first: int) -> Any:
    """Return a column of names as a dictionary of pyarrow and places in it.

    Raises:
        ValueError: The column has no names, or one is missing.
    """
    import pyarrow as arrow
    from pyarrow import compute

    if not (_is_text(column) or arrow.types.is_integer(column.type)):
        raise ValueError(
            f"{row.removesuffix(', row')}, {what} is of type {column.type}; names must be texts or whole numbers"
        )
    names = column.cast(arrow.string())
    if (missing := np.flatnonzero(_numpy(compute.binary_length(names), 0) == 0)).size:
        raise ValueError(f"{row} {first + missing[0]} has no name in {what}")
    return names.dictionary_encode()


def _places(columns: list[Any], sides: int) -> tuple[list[str], list[Ints]]:
    """Return the names of coded columns, in the order in which they first occur, and the place of each name.

    Args:
        columns: Columns, see `_coded`; those of several sides take turns.
        sides: Number of sides, each of which gets an array of places.
    """
    import pyarrow as arrow

    parts = arrow.chunked_array(columns).unify_dictionaries().chunks
    names: list[str] = parts[0].dictionary.to_pylist()
    indices = [_numpy(part.indices) for part in parts]
    return names, [np.concatenate(indices[side::sides], dtype=np.int64) for side in range(sides)]


def _numbers(column: Any, what: str, row: str, first: int) -> Floats:
    """Return a column as finite numbers, dates as seconds since 1970.

    Raises:
        ValueError: The column has no numbers, or a number is missing or not finite.
    """
    import pyarrow as arrow

    if arrow.types.is_timestamp(column.type) or arrow.types.is_date(column.type):
        values = date_seconds(column.to_numpy(zero_copy_only=False))
    else:
        try:
            values = _numpy(column.cast(arrow.float64(), safe=False), np.nan)
        except arrow.ArrowException:
            if not _is_text(column):
                raise ValueError(
                    f"{row.removesuffix(', row')}, {what} is of type {column.type}; it must be numbers"
                ) from None
            values = np.array([_number(text) for text in column.to_pylist()])
    if (wrong := np.flatnonzero(~np.isfinite(values))).size:
        at = int(wrong[0])
        shown = _text(column, at) if _is_text(column) else str(values[at])
        raise ValueError(f"{row} {first + at}: {what} is {shown!r}; it must be a number")
    return values


def _numpy(column: Any, missing: float = 0) -> Any:
    """Return numbers of pyarrow as an array; its own `to_numpy` imports pandas, which takes a quarter of a second."""
    return np.from_dlpack(column.fill_null(missing) if column.null_count else column)


def _number(text: str | None) -> float:
    """Return the number in a text, which may have spaces around it; NaN if there is none."""
    try:
        return float(text or "nan")
    except ValueError:
        return float("nan")


def _text(column: Any, place: int) -> str:
    return column[place].as_py() or ""


def _is_text(column: Any) -> bool:
    import pyarrow.types as kinds

    return bool(kinds.is_string(column.type) or kinds.is_large_string(column.type) or kinds.is_string_view(column.type))


# --- blocks of files ----------------------------------------------------------------------------------


def _read_blocks(path: Path, columns: Columns) -> Iterator[list[Any]]:
    """Yield the wanted columns of a table, block by block, as arrays of pyarrow: texts, where the file is CSV.

    Raises:
        ValueError: The file is no such table, or is damaged. The message names the file, and the row where it can. Or
            pyarrow is missing.
        OSError: The file cannot be read.
    """
    if columns.by_number and min(map(int, columns.wanted)) < 1:
        raise ValueError("columns are numbered from 1")
    try:
        import pyarrow as arrow
        import pyarrow.parquet
    except ImportError:
        raise ValueError(f"{path} needs pyarrow: pip install 'roletrust-env[data]'") from None
    read, kind = 0, "Parquet" if path.suffix == PARQUET else "CSV"
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as opened:
        file: Any = opened
        try:
            for block in (_parquet_blocks if kind == "Parquet" else _csv_blocks)(path, file, columns):
                yield block
                read += len(block[0])
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise ValueError(f"{path} is a damaged gzip file, after row {read}: {error}") from None
        except (UnicodeDecodeError, csv.Error, arrow.ArrowException, OSError) as error:
            reason = str(error).partition("\n")[0]
            if isinstance(error, UnicodeDecodeError) or "UTF8" in reason:
                reason = "it is not text in UTF-8"
            raise ValueError(f"{path} is no {kind} file, or a damaged one, after row {read}: {reason}") from None


def _csv_blocks(path: Path, file: IO[bytes], columns: Columns) -> Iterator[list[Any]]:
    import pyarrow as arrow
    from pyarrow import csv as arrow_csv

    names: list[str] = []
    read, rest, wrong = 0, None, list[Any]()

    def ragged(row: Any) -> str:
        wrong.append(row)
        return "error"

    for lines in _lines(file):
        if not read:
            lines = lines.removeprefix(codecs.BOM_UTF8)
            header = next(csv.reader([re.split(rb"[\r\n]", lines, maxsplit=1)[0].decode()], strict=True))
            names = [f"f{place}" for place in _column_places(path, columns, [one.strip() for one in header], "row 1")]
            convert = arrow_csv.ConvertOptions(
                include_columns=sorted(set(names)), default_column_type=arrow.string(), strings_can_be_null=False
            )
            every = [f"f{place}" for place in range(len(header))]
        try:
            table = arrow_csv.read_csv(
                arrow.BufferReader(lines),
                arrow_csv.ReadOptions(use_threads=False, block_size=len(lines) + 1, column_names=every),
                arrow_csv.ParseOptions(ignore_empty_lines=False, invalid_row_handler=ragged),
                convert,
            )
        except arrow.ArrowInvalid:
            for row in wrong:
                raise ValueError(
                    f"{path}, row {read + row.number} has {row.actual_columns} columns; "
                    f"{row.expected_columns} are needed, as in row 1"
                ) from None
            raise
        if lines.count(b"\n") > len(table):  # pyarrow takes all after a quote without end as one text
            raise ValueError(f"{path}, after row {read}: a quote has no end, or a text has several lines")
        first = 0 if read or columns.by_number else 1
        read += len(table)
        rest = table.slice(first) if rest is None else arrow.concat_tables([rest, table])
        while len(rest) >= _ROWS:
            yield [rest[name].slice(0, _ROWS).combine_chunks() for name in names]
            rest = rest.slice(_ROWS)
    if rest:
        yield [rest[name].combine_chunks() for name in names]
    elif not read:
        _column_places(path, columns, [], "row 1")


def _lines(file: IO[bytes]) -> Iterator[bytes]:
    """Yield the lines of a file, many at a time; the last one ends, too."""
    rest = b""
    while block := file.read(_BYTES):
        lines, end, rest = (rest + block).rpartition(b"\n")
        if end:
            yield lines + end
    if rest:
        yield rest + b"\n"


def _parquet_blocks(path: Path, file: IO[bytes], columns: Columns) -> Iterator[list[Any]]:
    import pyarrow.parquet as parquet
    import pyarrow.types as kinds

    table = parquet.ParquetFile(file, page_checksum_verification=True)
    header = table.schema_arrow.names
    names = [header[place] for place in _column_places(path, columns, header, "columns")]
    if twice := [name for name in names if header.count(name) > 1]:
        raise ValueError(f"{path} has several columns {twice[0]!r}")
    for batch in table.iter_batches(_ROWS, columns=sorted(set(names))):
        found = (batch.column(name) for name in names)
        yield [column.dictionary_decode() if kinds.is_dictionary(column.type) else column for column in found]


def _column_places(path: Path, columns: Columns, header: list[str], where: str) -> list[int]:
    """Return the places of the wanted columns among those of a file.

    Raises:
        ValueError: There is no such column, or more than one.
    """
    if columns.by_number:
        places = [int(name) - 1 for name in columns.wanted]
        if header and max(places) >= len(header):
            raise ValueError(f"{path} has {len(header)} columns; {max(places) + 1} are needed")
        return places
    for name in columns.wanted:
        if name not in header:
            raise ValueError(f"{path}, {where}: there is no column {name!r}{suggest(name, header, 'Columns:')}")
        if header.count(name) > 1:
            raise ValueError(f"{path}, {where}: there are several columns {name!r}")
    return [header.index(name) for name in columns.wanted]
