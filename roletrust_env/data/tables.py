"""Columns of tables, block by block, from CSV files and from Parquet files."""

import csv
import gzip
import zlib
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import IO, Any, NamedTuple, TypeAlias

import numpy as np

from roletrust_env.data.dates import date_seconds
from roletrust_env.errors import suggest
from roletrust_env.trust.ledger import Floats

_ROWS = 50_000  # read at a time

PARQUET = ".parquet"
"""Ending of the name of a Parquet file; any other file is CSV."""

ENDINGS = (".csv", ".csv.gz", PARQUET)
"""Endings of the names of tables in a folder."""


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


Texts: TypeAlias = list[str] | Floats
"""A column as texts, or as numbers: NaN for a missing one, and seconds since 1970 for a time."""


class Block(NamedTuple):
    """Some rows of a table.

    Attributes:
        raters: Names of the raters, empty where one is missing.
        ratees: Names of the ratees.
        ratings: Ratings.
        times: Times; None without.
    """

    raters: list[str]
    ratees: list[str]
    ratings: Texts
    times: Texts | None


def first_row(path: Path, columns: Columns) -> int:
    """Return the number of the first row with ratings in messages: 2 below the header of a CSV file, else 1."""
    return 1 if path.suffix == PARQUET or columns.by_number else 2


def read_blocks(path: Path, columns: Columns) -> Iterator[Block]:
    """Yield the rows of a table, block by block.

    Args:
        path: Path of a Parquet file (`.parquet`), or of a CSV file in UTF-8, with commas, also in gzip (`.gz`).
        columns: Columns to read.

    Raises:
        ValueError: The file is no such table, or is damaged. The message names the file, and the row where it can.
        OSError: The file cannot be read.
    """
    if columns.by_number and min(map(int, columns.wanted)) < 1:
        raise ValueError("columns are numbered from 1")
    return _parquet_blocks(path, columns) if path.suffix == PARQUET else _csv_blocks(path, columns)


# --- CSV ----------------------------------------------------------------------------------------------


def _csv_blocks(path: Path, columns: Columns) -> Iterator[Block]:
    read = 0
    try:
        with _opened(path) as file:
            rows = csv.reader(file, strict=True)
            where, first = _places(path, columns, rows), first_row(path, columns)
            while chunk := list(islice(rows, _ROWS)):
                yield _block(chunk, where, path, first + read)
                read += len(chunk)
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not text in UTF-8 after row {read}, so it is no CSV file") from None
    except csv.Error as error:
        raise ValueError(f"{path}, after row {read}: {error}; it is no CSV file") from None
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise ValueError(f"{path} is a damaged gzip file, after row {read}: {error}") from None


def _opened(path: Path) -> IO[str]:
    """Return an open text file. A byte-order mark is skipped."""
    if path.suffix == ".gz":
        return gzip.open(path, "rt", encoding="utf-8-sig", newline="")
    return path.open(encoding="utf-8-sig", newline="")


def _places(path: Path, columns: Columns, rows: Iterator[list[str]]) -> list[int]:
    """Return the places of the columns, from the header if they have names."""
    if columns.by_number:
        return [int(name) - 1 for name in columns.wanted]
    header = [name.strip() for name in next(rows, [])]
    return [_place(name, header, f"{path}, row 1") for name in columns.wanted]


def _place(name: str, header: list[str], where: str) -> int:
    """Return the place of a column."""
    if name not in header:
        raise ValueError(f"{where}: there is no column {name!r}{suggest(name, header, 'Columns:')}")
    if header.count(name) > 1:
        raise ValueError(f"{where}: there are several columns {name!r}")
    return header.index(name)


def _block(chunk: list[list[str]], where: list[int], path: Path, first: int) -> Block:
    """Return the columns of some rows."""
    needed = max(where) + 1
    for n, fields in enumerate(chunk):
        if len(fields) < needed:
            raise ValueError(f"{path}, row {first + n} has {len(fields)} columns; {needed} are needed")
    raters, ratees, ratings, *times = ([fields[place] for fields in chunk] for place in where)
    return Block(raters, ratees, ratings, times[0] if times else None)


# --- Parquet ------------------------------------------------------------------------------------------


def _parquet_blocks(path: Path, columns: Columns) -> Iterator[Block]:
    try:
        import pyarrow as arrow
        import pyarrow.parquet as parquet
    except ImportError:
        raise ValueError(f"{path} needs pyarrow: pip install 'roletrust-env[parquet]'") from None
    read = 0
    with path.open("rb") as opened:
        try:
            file = parquet.ParquetFile(opened, page_checksum_verification=True)
            names = _parquet_names(path, columns, file.schema_arrow.names)
            for batch in file.iter_batches(_ROWS, columns=sorted(set(names))):
                found = [batch.column(name) for name in names]
                people = [_names(path, name, column) for name, column in zip(names[:2], found[:2], strict=True)]
                ratings, *times = (
                    _numbers(path, name, column) for name, column in zip(names[2:], found[2:], strict=True)
                )
                yield Block(people[0], people[1], ratings, times[0] if times else None)
                read += len(batch)
        except (arrow.ArrowException, OSError) as error:
            reason = str(error).partition("\n")[0]
            raise ValueError(f"{path} is no Parquet file, or a damaged one, after row {read}: {reason}") from None


def _parquet_names(path: Path, columns: Columns, header: list[str]) -> list[str]:
    """Return the names of the columns in a file with these columns."""
    places = [
        int(name) - 1 if columns.by_number else _place(name, header, f"{path}, columns") for name in columns.wanted
    ]
    if max(places) >= len(header):
        raise ValueError(f"{path} has {len(header)} columns; {max(places) + 1} are needed")
    names = [header[place] for place in places]
    if twice := [name for name in names if header.count(name) > 1]:
        raise ValueError(f"{path} has several columns {twice[0]!r}")
    return names


def _names(path: Path, name: str, column: Any) -> list[str]:
    """Return a column of pyarrow as names."""
    import pyarrow.types as kinds

    column = column.dictionary_decode() if kinds.is_dictionary(column.type) else column
    if not (_is_text(column) or kinds.is_integer(column.type)):
        raise ValueError(f"{path}, column {name!r} is of type {column.type}; names must be texts or whole numbers")
    return ["" if one is None else str(one) for one in column.to_pylist()]


def _numbers(path: Path, name: str, column: Any) -> Texts:
    """Return a column of pyarrow as numbers, dates as seconds since 1970; texts stay."""
    import pyarrow as arrow
    import pyarrow.types as kinds

    column = column.dictionary_decode() if kinds.is_dictionary(column.type) else column
    if _is_text(column):
        return ["" if one is None else one for one in column.to_pylist()]
    if kinds.is_timestamp(column.type) or kinds.is_date(column.type):
        return date_seconds(column.to_numpy(zero_copy_only=False))
    try:
        return np.asarray(column.cast(arrow.float64(), safe=False).to_numpy(zero_copy_only=False), np.float64)
    except arrow.ArrowException:
        raise ValueError(f"{path}, column {name!r} is of type {column.type}; it must be numbers") from None


def _is_text(column: Any) -> bool:
    import pyarrow.types as kinds

    return bool(kinds.is_string(column.type) or kinds.is_large_string(column.type) or kinds.is_string_view(column.type))
