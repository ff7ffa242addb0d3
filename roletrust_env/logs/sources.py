"""Tables of pyarrow from the files and data frames that people have."""

import bz2
import codecs
import csv
import errno
import gzip
import io
import lzma
import os
import re
import sqlite3
import zipfile
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from datetime import datetime
from decimal import Decimal
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from roletrust_env.errors import short
from roletrust_env.parameters import truth_value
from roletrust_env.storage.untrusted import parse_json

_HEAD = 1 << 16
"""Number of bytes in which the separator of a text is found."""

_SEPARATORS = (",", ";", "\t", "|", " ")
_COMMENTS = ("#", "%")
_LINE_ENDS = re.compile("\r\n|\n|\r")
_TABLES = (".parquet", ".pq", ".feather", ".arrow", ".sqlite", ".sqlite3", ".db", ".xlsx")
_PACKED_STARTS = (b"\x1f\x8b", b"PK\x03\x04", b"BZh", b"\xfd7zXZ")
_NAMED = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "blank": " "}
_PACKED = {".gz": gzip.decompress, ".xz": lzma.decompress, ".bz2": bz2.decompress}
_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)

TimeUnit = Literal["s", "ms", "us", "ns"]
"""Unit of times that are numbers, since 1970 where they are dates."""


@dataclass(frozen=True)
class Reading:
    """What a reader needs to know about a source, beyond its columns.

    Attributes:
        skip: Number of lines at the beginning of a text that are left out, such as a title.
        header: Whether the first row of a text has the names of the columns. Without a header,
            columns are numbers from 1.
        separator: Text between two columns; None finds a comma, semicolon, tab, bar or blank.
        encoding: Encoding of a text; None is UTF-8, or UTF-16 with a byte order mark.
        decimal: Decimal mark of numbers that are texts: `"."` or `","`.
        time_format: Form of dates that are not those of ISO 8601, such as `"%d.%m.%Y"`.
        time_unit: Unit of times that are numbers: `"s"`, `"ms"`, `"us"` or `"ns"`.
        labels: Numbers of ratings that are texts, such as `{"yes": 1, "no": 0}`. Upper case does
            not matter. They add to numbers.
        missing: Texts that stand for a missing value, also `""`. Rows with one are left out.
        repeats: Whether a row may be the same as an earlier one, also in its time.
        table: Table of a SQLite file, or sheet of a workbook, if it has several.

    Raises:
        ValueError: A value is not allowed.
    """

    skip: int = 0
    header: bool = True
    separator: str | None = None
    encoding: str | None = None
    decimal: str = "."
    time_format: str | None = None
    time_unit: str = "s"
    labels: dict[str, float] = field(default_factory=dict)
    missing: tuple[str, ...] = ()
    repeats: bool = False
    table: str | None = None

    def __post_init__(self) -> None:
        for name in ("header", "repeats"):
            object.__setattr__(self, name, truth_value(name, getattr(self, name)))
        for name, value, allowed in (
            ("decimal", self.decimal, (".", ",")),
            ("time_unit", self.time_unit, get_args(TimeUnit)),
        ):
            if value not in allowed:
                raise ValueError(f"{name} must be one of {allowed}, got {value!r}")
        if isinstance(self.skip, bool) or not isinstance(self.skip, int) or self.skip < 0:
            raise ValueError(f"skip must be a number of lines, got {self.skip!r}")
        for name in ("separator", "encoding", "time_format", "table"):
            text = getattr(self, name)
            if text is not None and (not isinstance(text, str) or not text):
                raise ValueError(f"{name} must be a text, got {text!r}")
        texts = self.missing if isinstance(self.missing, tuple | list) else [None]
        if not all(isinstance(text, str) for text in texts):
            raise ValueError(f"missing must be a list of texts, got {self.missing!r}")
        object.__setattr__(self, "missing", tuple(texts))
        if self.time_format is not None and not _has_day(self.time_format):
            raise ValueError(
                f"time_format must have a year and a day, such as %Y-%m-%d, got "
                f"{self.time_format!r}"
            )
        if not isinstance(self.labels, dict) or not all(isinstance(k, str) for k in self.labels):
            raise ValueError(f"labels must map texts to numbers, got {self.labels!r}")
        for text, number in self.labels.items():
            finite = isinstance(number, int | float) and abs(number) < float("inf")
            if isinstance(number, bool) or not finite:
                raise ValueError(f"the rating of label {text!r} must be a number, got {number!r}")


def _has_day(form: str) -> bool:
    """Return whether a form of dates states the year and the day."""
    has = set(re.findall("%([A-Za-z])", form))
    return bool(has & {"c", "x", "s"} or (has & {"Y", "y"} and has & {"d", "j"}))


class Source(NamedTuple):
    """A table as it was read.

    Attributes:
        table: Table of pyarrow; its columns are texts where the source is a text.
        name: Path of the file, or what the object is, for error messages.
        first: Number of the first row of the table in the source.
        about: How it was read.
    """

    table: Any
    name: str
    first: int
    about: str

    def row(self, place: int) -> str:
        """Return the name of the source and the number of a row, by its place from 0."""
        return f"{self.name}, row {self.first + int(place)}"


def open_source(source: Any, reading: Reading) -> Source:
    """Return a source as a table.

    Args:
        source: Path of a file or of a folder of Parquet files, a mapping of columns, or a data
            frame with Arrow's C stream interface, such as those of pandas, polars and DuckDB.
        reading: What is known about it.

    Raises:
        ValueError: The source is not such a table, or is damaged; or a package is missing.
        OSError: The file cannot be read.
    """
    try:
        import pyarrow as arrow
    except ImportError:
        raise ValueError(
            "reading ratings needs pyarrow: pip install 'roletrust-env[logs]'"
        ) from None
    if isinstance(source, str | Path):
        return _open_file(Path(source), reading)
    kind = type(source).__name__
    if hasattr(source, "__arrow_c_stream__") or isinstance(source, dict):
        try:
            if isinstance(source, dict):
                lists = {
                    name: list(values) if isinstance(values, tuple) else values
                    for name, values in source.items()
                }
                if wrong := [name for name in lists if isinstance(lists[name], str | bytes | set)]:
                    raise ValueError(f"column {wrong[0]!r} is not a list or an array")
                plain = {name: v for name, v in lists.items() if isinstance(v, list)}
                checked = _as_table(plain)
                source = {**lists, **{name: checked.column(name) for name in plain}}
            return Source(arrow.table(source), f"the {kind}", 1, kind)
        except (arrow.ArrowException, TypeError, ValueError) as error:
            raise ValueError(f"the {kind} is not a table of ratings: {_line(error)}") from None
    raise ValueError(
        f"the source is of type {kind}; it must be a path, a data frame (pandas, polars, DuckDB, "
        "Arrow) or a mapping of columns"
    )


def _open_file(path: Path, reading: Reading) -> Source:
    """Return a file, or a folder of Parquet files, as a table."""
    import pyarrow as arrow
    from pyarrow import feather, parquet

    suffix, about = path.suffix.lower(), path.suffix.lower()
    try:
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
        if path.is_dir():
            return Source(_folder(path), str(path), 1, "a folder of Parquet files")
        if not reading.header and suffix in (*_TABLES, ".json", ".jsonl", ".ndjson"):
            raise ValueError("header=false is for texts")
        if suffix in (".parquet", ".pq"):
            return Source(parquet.ParquetFile(path).read(), str(path), 1, "Parquet")
        if suffix in (".feather", ".arrow"):
            return Source(feather.read_table(path), str(path), 1, "Feather")
        if suffix in (".sqlite", ".db", ".sqlite3"):
            return Source(_sqlite(path, reading.table), str(path), 1, "SQLite")
        if suffix == ".xlsx":
            return Source(_workbook(path, reading.table), str(path), 2, "workbook")
        data = path.read_bytes()
        if suffix == ".zip" or suffix in _PACKED:
            data, about = _unpacked(path, data)
        if about in (".json", ".jsonl", ".ndjson"):
            return Source(_json(_as_utf8(data, reading.encoding)), str(path), 1, "JSON")
        return _text(data, path, reading)
    except (arrow.ArrowException, csv.Error, sqlite3.Error, ValueError, KeyError) as error:
        raise ValueError(
            f"{path} cannot be read as {_guess(path, about)}: {_line(error)}"
        ) from None


def _guess(path: Path, suffix: str) -> str:
    """Return what a file seems to be by its name."""
    kinds = {".parquet": "Parquet", ".pq": "Parquet", ".xlsx": "a workbook", ".feather": "Feather"}
    kinds |= dict.fromkeys((".json", ".jsonl", ".ndjson"), "JSON")
    kinds |= dict.fromkeys((".sqlite", ".db", ".sqlite3"), "SQLite")
    return "a folder of Parquet files" if path.is_dir() else kinds.get(suffix, "CSV")


def _line(error: BaseException) -> str:
    return short(" ".join(str(error).split()) or type(error).__name__)


def _folder(path: Path) -> Any:
    """Return the Parquet files in a folder as a table; all must have the same columns."""
    from pyarrow import dataset

    files = dataset.dataset(path, format="parquet", partitioning="hive")
    fragments = list(files.get_fragments())
    if not fragments:
        raise ValueError("it has no Parquet files")
    for fragment in fragments:
        if not fragment.physical_schema.equals(fragments[0].physical_schema):
            raise ValueError(
                f"{Path(fragment.path).name} has other columns, or of other types, than "
                f"{Path(fragments[0].path).name}"
            )
    return files.to_table()


def _unpacked(path: Path, data: bytes) -> tuple[bytes, str]:
    """Return the content of a packed file, and the ending of its name."""
    suffix = path.suffix.lower()
    try:
        if suffix != ".zip":
            return _PACKED[suffix](data), path.with_suffix("").suffix.lower()
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [name for name in archive.namelist() if not name.endswith("/")]
            if len(names) != 1:
                raise ValueError(f"it holds {len(names)} files; an archive must hold one")
            return archive.read(names[0]), Path(names[0]).suffix.lower()
    except (
        *(OSError, EOFError, zlib.error, lzma.LZMAError, zipfile.BadZipFile),
        *(RuntimeError, NotImplementedError),  # a password, or an unknown way to pack
    ) as error:
        raise ValueError(f"the {suffix} file cannot be unpacked: {_line(error)}") from None


def _sqlite(path: Path, table: str | None) -> Any:
    """Return a table of a SQLite file."""
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as file:
        known = [
            name
            for (name,) in file.execute(
                "SELECT name FROM sqlite_master WHERE type IN ('table', 'view') "
                "AND name NOT LIKE 'sqlite_%' ORDER BY 1"
            )
        ]
        name = _chosen(table, known)
        quoted = name.replace('"', '""')
        rows = file.execute(f'SELECT * FROM "{quoted}"')
        names = [column[0] for column in rows.description]
        columns = list(zip(*rows, strict=True)) or [()] * len(names)
    return _as_table(dict(zip(names, map(list, columns), strict=True)))


def _workbook(path: Path, table: str | None) -> Any:
    """Return a sheet of a workbook, whose first row has the names of the columns."""
    try:
        from openpyxl import load_workbook
    except ImportError:
        raise ValueError("a workbook needs openpyxl: pip install openpyxl") from None
    try:
        book = load_workbook(path, data_only=True)
        sheets = {sheet.title: sheet for sheet in book.worksheets}
        names, *rows = list(sheets[_chosen(table, list(sheets))].iter_rows(values_only=True))
    except Exception as error:  # openpyxl raises many kinds at a damaged file
        raise ValueError(_line(error)) from None
    full = [row for row in rows if any(value is not None for value in row)]
    columns = list(zip(*full, strict=True)) or [()] * len(names)
    return _as_table({str(name): list(v) for name, v in zip(names, columns, strict=True)})


def _chosen(table: str | None, known: list[str]) -> str:
    """Return the table that was asked for, or the only one."""
    if table is None and len(known) == 1:
        return known[0]
    if table not in known:
        asked = f"no table {table!r}" if table else "table must name one"
        raise ValueError(f"{asked}; it has the tables {', '.join(known) or '(none)'}")
    return table


def _json(data: bytes) -> Any:
    """Return JSON, one object in each line or all in an array, as a table."""
    rows = list[Any]()
    if data.lstrip().startswith(b"["):
        rows = parse_json(data)
    else:
        for number, line in enumerate(data.split(b"\n"), 1):
            try:
                rows += [parse_json(line)] if line.strip() else []
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
    if not rows or not all(isinstance(row, dict) for row in rows):
        raise ValueError("it must have one object in each line, or an array of objects")
    names = list(dict.fromkeys(name for row in rows for name in row))
    return _as_table({name: [row.get(name) for row in rows] for name in names})


def _as_table(columns: Mapping[str, Sequence[Any]]) -> Any:
    """Return columns of Python's values as a table. One with values of several types becomes a
    column of structs, which is refused if it is used.
    """
    import pyarrow as arrow

    table = dict[str, Any]()
    for name, values in columns.items():
        try:
            table[name] = value_column(values)
        except (ValueError, TypeError, OverflowError, arrow.ArrowException):
            table[name] = arrow.array([{"value": str(value)} for value in values])
    return arrow.table(table)


def value_column(values: Sequence[Any]) -> Any:
    """Return Python's values as a column of pyarrow; numbers next to texts become texts.

    Raises:
        ValueError: The values are of several types, such as dates and numbers, or some have a time
            zone and others do not.
    """
    import pyarrow as arrow

    values = [
        value.item() if isinstance(value, np.number | np.bool_) else value for value in values
    ]
    known = [value for value in values if value is not None and value == value]  # nor NaT
    if any(isinstance(value, datetime) for value in known):
        zones = {getattr(value, "tzinfo", "no date") is None for value in known}
        if not all(isinstance(value, datetime) for value in known) or len(zones) > 1:
            raise ValueError("there are dates with a time zone or a time, and others without")
        moments = [value if value == value else None for value in values]  # without NaT
        return arrow.array(moments, arrow.timestamp("ns", None if True in zones else "UTC"))
    kinds = {type(value) for value in known}
    if len(kinds) > 1 and not kinds <= {int, float, str, Decimal}:
        raise ValueError(f"there are values of the types {sorted(k.__name__ for k in kinds)}")
    if Decimal in kinds and float in kinds and str not in kinds:
        return arrow.array([None if value is None else float(value) for value in values])
    if str in kinds and len(kinds) > 1:
        return arrow.array([None if value is None else _plain_text(value) for value in values])
    return arrow.array(values)


def _plain_text(value: Any) -> str:
    whole = isinstance(value, float) and value.is_integer()
    return str(int(value)) if whole else str(value)


def _text(data: bytes, path: Path, reading: Reading) -> Source:
    """Return a text with separated columns as a table of texts."""
    import pyarrow as arrow
    from pyarrow import csv as arrow_csv

    if data.startswith(_PACKED_STARTS):
        raise ValueError("it is packed, so its name needs an ending: .gz, .zip, .bz2 or .xz")
    data = _as_utf8(data, reading.encoding)
    if b"\0" in data[:_HEAD]:
        raise ValueError("it has bytes that are not a text")
    lines = _LINE_ENDS.split(data[:_HEAD].decode("utf-8", "replace"))
    lines = lines[: len(lines) - (len(data) > _HEAD)]  # the last line may be cut
    skipped = reading.skip
    while skipped < len(lines) and _is_comment(lines[skipped]):
        skipped += 1
    lines = [line for line in lines[skipped:] if line.strip()]
    if not lines:
        raise ValueError("it has no rows, or more than 64 KiB of comments before them")
    if reading.header and lines[0].count('"') % 2:
        raise ValueError("the name of a column has a line break")
    separator = _NAMED.get(reading.separator or "", reading.separator)
    separator = separator or _separator(lines, reading.decimal)
    if len(separator) != 1:
        raise ValueError(f"the separator is {separator!r}; it must be one letter")
    first = next(csv.reader(lines, delimiter=separator))
    names = [text.strip() for text in first]
    if not reading.header:
        names = [str(number) for number in range(1, len(first) + 1)]
    positions = [str(position) for position in range(len(first))]

    def parsed(threads: bool) -> Any:
        return arrow_csv.read_csv(
            arrow.BufferReader(data),
            arrow_csv.ReadOptions(
                use_threads=threads,
                column_names=positions,
                skip_rows=skipped + reading.header,
                block_size=1 << 24,
            ),
            arrow_csv.ParseOptions(delimiter=separator, newlines_in_values=b'"' in data),
            arrow_csv.ConvertOptions(
                column_types=dict.fromkeys(positions, arrow.string()), strings_can_be_null=False
            ),
        )

    try:
        table = parsed(threads=True)
    except arrow.ArrowInvalid:
        try:
            table = parsed(threads=False)  # then its error has the number of the row
        except arrow.ArrowInvalid as error:
            raise ValueError(f"{_line(error)}; skip=N leaves out the first N lines") from None
    named = {value: name for name, value in _NAMED.items()}.get(separator, separator)
    about = f"CSV with the separator {named}"
    return Source(table.rename_columns(names), str(path), skipped + reading.header + 1, about)


def _as_utf8(data: bytes, encoding: str | None) -> bytes:
    """Return a text in UTF-8 without a byte order mark.

    Raises:
        ValueError: The text has another encoding than is stated.
    """
    if encoding is None and data.startswith(_MARKS):
        encoding = "utf-16"
    if encoding is not None:
        try:
            return data.decode(encoding).removeprefix("\ufeff").encode()
        except LookupError:
            raise ValueError(f"encoding {encoding!r} is unknown") from None
    data = data.removeprefix(codecs.BOM_UTF8)
    try:
        str(memoryview(data), "utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ValueError(
            f"row {line} has the byte 0x{data[error.start]:02x}, which is not UTF-8; name the "
            "encoding, such as encoding=latin-1"
        ) from None
    return data


def _is_comment(line: str) -> bool:
    return not line.strip() or line.startswith((*_COMMENTS, "sep="))


def _separator(lines: list[str], decimal: str) -> str:
    """Return the separator that cuts the lines into the same number of columns, two or more. A
    decimal mark is none.

    Raises:
        ValueError: None does.
    """
    separators = [separator for separator in _SEPARATORS if separator != decimal]
    for separator in separators:
        widths = Counter(len(row) for row in csv.reader(lines, delimiter=separator) if row)
        if len(widths) == 1 and max(widths) > 1:
            return separator
    counts = {text: lines[0].count(text) for text in (*separators, "::") if text in lines[0]}
    shown = f"; the first line is {short(repr(lines[0]))}"
    if "::" in counts and re.search(r"\S::\S", lines[0]):
        raise ValueError(f"columns seem to be separated by '::', which is not one letter{shown}")
    best = max(counts, key=lambda text: counts[text], default=None)
    if best is None:
        raise ValueError(f"its lines have a single column{shown}")
    return best
