"""Blocks of the rows of a table: CSV in any dialect, JSON lines, an array of JSON or Parquet, read
by pyarrow.
"""

import codecs
import csv
import gzip
import io
import itertools
import json
import re
import zlib
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import IO, Any, NoReturn

import numpy as np

from roletrust_env.data.columns import by_number, find_columns
from roletrust_env.data.dialect import MARKS, Dialect, delimiter, find_encoding, look, tidy
from roletrust_env.data.feedback import as_ratings, feedback_columns
from roletrust_env.data.values import is_missing, to_numpy

_KINDS = {
    ".parquet": "Parquet",
    ".pq": "Parquet",
    ".jsonl": "JSON",
    ".ndjson": "JSON",
    ".json": "JSON",
}

ENDINGS = tuple(end + packed for end in (".csv", ".tsv", ".txt", *_KINDS) for packed in ("", ".gz"))
"""Endings of the names of tables in a folder. A file with another ending is CSV, too."""

_ROWS = 50_000  # in a block
_BYTES = 1 << 23  # of a text that are parsed at a time
_HEAD = 1 << 20  # bytes in which the dialect is found
_TEXT = 1 << 16  # bytes of a text of several lines
_LONGEST, _LARGEST = 1 << 26, 1 << 30  # bytes of a line, and of an array of JSON
_DEPTH = 100  # JSON in JSON; pyarrow's parser ends the process from some thousands on
_BLAND = bytes(set(range(256)) - set(b'[]{}"'))
_LONG = re.compile(
    rb"(?=[\d.]{17})\d{9,}\.\d+"
)  # times since 1970 in decimals, which float64 would round
_OBJECTS = "it must be one JSON object in each line, or in an array"

Block = list[Any]
"""Columns of pyarrow, in the order of the wanted ones."""


class Table:
    """A file of ratings or votes.

    Attributes:
        path: Path of the file.
        wanted: Names of the columns that are read, by role.
        dialect: Parts of the dialect that are known.
        labels: Texts that are ratings, in small letters.
        missing: Whether rows are left out in which a wanted value is missing.
        tag: Tag of the feedback events that count; None for all.
        found: What has been found: kind of the file, dialect, and columns with other names than
            their roles.
        decimal_comma: Whether a number may have a comma in place of its point.
        blank: Number of blank rows.
        comments: Number of lines of comment.
        incomplete: Number of rows that were left out, since a value is missing.
    """

    def __init__(
        self,
        path: Path,
        wanted: Mapping[str, str],
        dialect: Dialect,
        labels: Collection[str] = (),
        *,
        missing: bool = False,
        tag: str | None = None,
    ) -> None:
        self.path, self.wanted, self.dialect, self.labels, self.missing = (
            path,
            wanted,
            dialect,
            labels,
            missing,
        )
        self.tag = tag
        self.found: list[str] = []
        self.decimal_comma = False
        self.blank = self.comments = self.incomplete = 0
        self._more: dict[str, int] = {}  # further columns of feedback events
        self._first = 1  # number of the first row
        self._read = 0  # rows
        self._left_out: list[int] = []  # places of rows that are not in blocks, ascending

    def row(self, place: int) -> str:
        """Return the path of the file and the number of a row, by its place among those of all
        blocks, from 0.
        """
        for gone in self._left_out:
            place += gone <= place
        return f"{self.path}, row {self._first + place}"

    def blocks(self) -> Iterator[Block]:
        """Yield the wanted columns, block by block. Rows in which all of these are empty are left
        out.

        Raises:
            ValueError: The file is no such table, or is damaged. The message names the file, and
                the row where it can. Or pyarrow is missing.
            OSError: The file cannot be read.
        """
        try:
            import pyarrow as arrow
            import pyarrow.parquet
        except ImportError:
            raise ValueError(
                f"{self.path} needs pyarrow: pip install 'roletrust-env[data]'"
            ) from None
        packed = self.path.suffix.lower() == ".gz"
        kind = _KINDS.get(
            (self.path.with_suffix("") if packed else self.path).suffix.lower(), "CSV"
        )
        read = {"Parquet": self._parquet, "JSON": self._json, "CSV": self._csv}[kind]
        with gzip.open(self.path) if packed else self.path.open("rb") as opened:
            file: Any = opened
            try:
                blocks = read(file if file.seekable() else io.BytesIO(file.read()))
                if (first := next(blocks, None)) is not None:
                    rest = itertools.chain([first], blocks)
                    yield from self._feedback(list(rest)) if self._more else rest
            except (EOFError, zlib.error, gzip.BadGzipFile) as error:
                raise ValueError(
                    f"{self.path} is a damaged gzip file, after row {self._read}: {error}"
                ) from None
            except (UnicodeError, csv.Error, arrow.ArrowException, OSError, OverflowError) as error:
                reason = str(error).partition("\n")[0]
                raise ValueError(
                    f"{self.path} is no {kind} file, or a damaged one, after row {self._read}: "
                    f"{reason}"
                ) from None

    def _places(self, where: str, header: list[str] | None, width: int) -> list[int]:
        """Return the places of the wanted columns, and say which they are, where they have other
        names.
        """
        places = find_columns(self.wanted, f"{self.path}, {where}", header, width)
        for (role, name), place in zip(self.wanted.items(), places, strict=True):
            if header is None or header[place] != role or name != role:
                self.found.append(
                    f"{role} in column {place + 1 if header is None else repr(header[place])}"
                )
        self._more = feedback_columns(header or [])
        if self.tag is not None and "tag1" not in self._more:
            raise ValueError(f"{self.path}, {where}: there are no feedback events with tags")
        return [*places, *self._more.values()]

    def _feedback(self, blocks: list[Block]) -> Iterator[Block]:
        """Yield feedback events as ratings, in one block."""
        import pyarrow as arrow

        columns = [
            [value for part in parts for value in part.to_pylist()]
            for parts in zip(*blocks, strict=True)
        ]
        names = list(self.wanted)
        more = dict(zip(self._more, columns[len(names) :], strict=True))
        feedback = as_ratings(columns[0], columns[1], columns[2], self.tag, more)
        kept = feedback.kept & ~(self.missing & np.isnan(feedback.values))
        self.incomplete += int(feedback.kept.sum() - kept.sum())
        self.found += ["feedback events of ERC-8004", *feedback.words]
        places = np.delete(np.arange(self._read), self._left_out)
        self._left_out = sorted([*self._left_out, *places[~kept].tolist()])
        ratings = [
            arrow.array(column) for column in (feedback.raters, feedback.agents, feedback.values)
        ]
        if len(names) > 3:
            times = (arrow.table({"time": block[3]}) for block in blocks)
            ratings.append(
                arrow.concat_tables(times, promote_options="default")["time"].combine_chunks()
            )
        if kept.any():
            yield [column.filter(arrow.array(kept)) for column in ratings]

    def _cleaned(self, table: Any, names: list[str], gone: list[int]) -> Iterator[Block]:
        """Yield a table in blocks, without blank rows, and without those that miss a value if these
        are left out.

        Args:
            table: Rows.
            names: Names of the wanted columns.
            gone: Places of lines that are no rows, among both, ascending.
        """
        missing = self.missing and not self._more  # an event that takes another back has no value
        drop, whole = None, len(table) + len(gone)
        empty = [
            is_missing(table[name], value=role > 1)
            for role, name in enumerate(names[: 4 if missing else 1])
        ]
        if any(column.any() for column in empty):
            blank = np.logical_and.reduce([is_missing(table[name]) for name in names])
            drop = np.logical_or.reduce(empty) if missing else blank
            self.blank += int(blank.sum())
            self.incomplete += int(drop.sum() - blank.sum())
            places = np.delete(np.arange(whole), gone)
            gone = sorted([*gone, *places[drop].tolist()])
            table = table.filter(~drop)
        self._left_out += [self._read + place for place in gone]
        self._read += whole
        for batch in filter(len, table.to_batches(_ROWS)):
            yield [batch[name] for name in names]

    # --- CSV
    # ------------------------------------------------------------------------------------------

    def _csv(self, file: IO[bytes]) -> Iterator[Block]:
        import pyarrow as arrow
        from pyarrow import compute
        from pyarrow import csv as arrow_csv

        head = file.read(_HEAD)
        file.seek(0)
        try:
            encoding = self.dialect.encoding or find_encoding(head)
            text = codecs.getincrementaldecoder(encoding)("replace").decode(head)
        except LookupError:
            raise ValueError(
                f"unknown encoding {self.dialect.encoding!r}; one is utf-8, utf-16 or latin-1"
            ) from None
        except ValueError as error:
            raise ValueError(f"{self.path} is no CSV file: {error}") from None
        if not text.strip():
            return
        if len(head) == _HEAD:  # the last line may be cut
            text = text[: text.rfind("\n") + 1] or text
        named = () if by_number(self.wanted) else self.wanted.values()
        start = look(text, self.dialect, named, self.labels)
        self.found[:0] = [f"CSV, {start}, {encoding.removesuffix('-sig')}"]
        self.decimal_comma = start.separator != ","
        self._first = 1 + start.lines
        self.comments = len(
            re.findall(f"(?m)^[{''.join(MARKS)}]", "".join(text.splitlines(True)[: start.lines]))
        )
        places = self._places(f"row {max(1, start.lines)}", start.header, start.width)
        names, every = (
            [f"f{place}" for place in places],
            [f"f{place}" for place in range(start.width)],
        )
        one, skipped, wrong = delimiter(start.separator), list[int](), list[Any]()
        end = (
            one * (start.width - 1) + "\n"
        ).encode()  # a last row, which is not there if a quote is still open

        def ragged(row: Any) -> str:
            comment = row.text.startswith(MARKS)
            if not comment and row.text.strip(one + " \t\r\n"):
                wrong.append(row)
                return "error"
            self.comments += comment
            self.blank += not comment
            skipped.append(row.number - 1)
            return "skip"

        for lines in _lines(file, encoding, start.lines):
            self._check_utf8(lines, "; name the encoding: --encoding latin-1")
            tidied = tidy(lines, start.separator) + end
            skipped.clear()
            try:
                table = arrow_csv.read_csv(
                    arrow.BufferReader(tidied),
                    arrow_csv.ReadOptions(
                        use_threads=False, block_size=len(tidied) + 1, column_names=every
                    ),
                    arrow_csv.ParseOptions(
                        delimiter=one,
                        ignore_empty_lines=False,
                        newlines_in_values=True,
                        invalid_row_handler=ragged,
                    ),
                    arrow_csv.ConvertOptions(
                        include_columns=sorted({*names, *every[:1]}),
                        default_column_type=arrow.string(),
                        strings_can_be_null=False,
                    ),
                )
            except arrow.ArrowInvalid:
                for row in wrong:
                    what = (
                        f" has {row.actual_columns} columns; {row.expected_columns} are needed, "
                        "as in the rows above"
                    )
                    self._fault(
                        row.number - 1, ": a quote has no end" if row.text.count('"') % 2 else what
                    )
                raise
            last = table.slice(len(table) - 1)
            if not all(is_missing(last[name])[0] for name in names):
                self._fault(len(table) + len(skipped) - 1, ": a quote has no end")
            table = table.slice(0, len(table) - 1)
            if start.comments:
                is_comment = to_numpy(
                    compute.match_substring_regex(table["f0"], f"^[{''.join(MARKS)}]").cast(
                        arrow.uint8()
                    )
                )
                self.comments += int(is_comment.sum())
                rows = np.delete(np.arange(len(table) + len(skipped)), skipped)
                skipped.extend(rows[is_comment > 0].tolist())
                table = table.filter(is_comment == 0)
            yield from self._cleaned(table, names, sorted(skipped))

    def _check_utf8(self, lines: bytes, hint: str) -> None:
        """Refuse lines that are not UTF-8, by the row."""
        try:
            lines.decode()
        except UnicodeDecodeError as error:
            what = f": byte 0x{lines[error.start]:02x} is no UTF-8{hint}"
            self._fault(lines.count(b"\n", 0, error.start), what)

    def _fault(self, place: int, what: str) -> NoReturn:
        """Raise an error about a row, by its place among those that are not yet counted as read."""
        raise ValueError(f"{self.path}, row {self._first + self._read + place}{what}")

    # --- JSON and Parquet
    # -----------------------------------------------------------------------------

    def _json(self, file: IO[bytes]) -> Iterator[Block]:
        import pyarrow as arrow
        from pyarrow import json as arrow_json

        header, array = (
            list[str](),
            file.read(_TEXT).removeprefix(codecs.BOM_UTF8).lstrip().startswith(b"["),
        )
        file.seek(0)
        for lines in self._array(file.read(_LARGEST + 1)) if array else _lines(file, "utf-8-sig"):
            if not lines.strip():
                continue
            self._check_utf8(lines, ", in which JSON is written")
            if not lines.lstrip().startswith(b"{"):  # at a null, pyarrow's parser ends the process
                self._fault(0, f": no object begins here; {_OBJECTS}")
            if _is_deep(lines):
                raise ValueError(
                    f"{self.path} has JSON nested more than {_DEPTH} deep, after row {self._read}"
                )
            options = arrow_json.ReadOptions(use_threads=False, block_size=len(lines) + 1)
            try:
                table = arrow_json.read_json(arrow.BufferReader(lines), options)
                if dates := [
                    field.name for field in table.schema if arrow.types.is_timestamp(field.type)
                ]:
                    texts = arrow.schema(
                        [(name, arrow.string()) for name in dates]
                    )  # a name may look like a date
                    parse = arrow_json.ParseOptions(explicit_schema=texts)
                    table = arrow_json.read_json(arrow.BufferReader(lines), options, parse)
                if any(map(arrow.types.is_timestamp, table.flatten().schema.types)) or _LONG.search(
                    lines
                ):
                    table = self._json_texts(lines)
            except arrow.ArrowInvalid as error:
                reason, _, row = (
                    str(error).removeprefix("JSON parse error: ").rpartition(" in row ")
                )
                if re.search("/.* changed from (?:string to number|number to string)", reason):
                    table = self._json_texts(lines)
                elif row.isdecimal():
                    self._fault(int(row), f": {reason}; {_OBJECTS}".replace(".;", ";"))
                else:
                    raise
            table = table.flatten()
            every, inner = table.column_names, "args."  # the arguments of an event
            short = [name.removeprefix(inner) for name in every]
            table = table.rename_columns(
                [one if one not in every else name for one, name in zip(short, every, strict=True)]
            )
            if not header:
                header = table.column_names
                self.found.append("JSON array" if array else "JSON lines")
                names = [header[place] for place in self._places("columns", header, len(header))]
            for name in set(names).difference(table.column_names):
                table = table.append_column(name, arrow.nulls(len(table)))
            yield from self._cleaned(table, names, [])

    def _array(self, text: bytes) -> Iterator[bytes]:
        """Yield the values of an array of JSON as lines, many at a time."""
        if len(text) > _LARGEST:
            raise ValueError(
                f"{self.path} is an array of more than {_LARGEST:,} bytes; JSON lines have no limit"
            )
        try:
            rows = json.loads(text, parse_float=_json_number, object_pairs_hook=_json_object)
        except (ValueError, RecursionError) as error:
            raise ValueError(
                f"{self.path} is no array of JSON objects, or a damaged one: {error}"
            ) from None
        for start in range(0, len(rows), _ROWS):
            yield "".join(f"{json.dumps(row)}\n" for row in rows[start : start + _ROWS]).encode()

    def _json_texts(self, lines: bytes) -> Any:
        """Return JSON lines as a table of texts, where numbers and texts are in one column."""
        import pyarrow as arrow

        rows = list[dict[str, Any]]()
        for line in filter(bytes.strip, lines.splitlines()):
            try:
                row = json.loads(line, parse_float=_json_number)
                rows.append(
                    {
                        **row,
                        **{
                            f"args.{name}": value for name, value in (row.get("args") or {}).items()
                        },
                    }
                )
            except (ValueError, AttributeError, TypeError):
                self._fault(len(rows), f": {_OBJECTS}")
        names = dict.fromkeys(name for row in rows for name in row)
        return arrow.table({name: [_json_text(row.get(name)) for row in rows] for name in names})

    def _parquet(self, file: IO[bytes]) -> Iterator[Block]:
        import pyarrow as arrow
        import pyarrow.parquet as parquet

        table = parquet.ParquetFile(file, page_checksum_verification=True)
        header = table.schema_arrow.names
        self.found.append("Parquet")
        names = [header[place] for place in self._places("columns", header, len(header))]
        if twice := [name for name in names if header.count(name) > 1]:
            raise ValueError(f"{self.path} has several columns {twice[0]!r}")
        for batch in table.iter_batches(_ROWS, columns=sorted(set(names))):
            batch.validate(full=True)  # texts are UTF-8
            columns = {name: batch.column(name) for name in names}
            decoded = {
                name: column.dictionary_decode()
                if arrow.types.is_dictionary(column.type)
                else column
                for name, column in columns.items()
            }
            yield from self._cleaned(arrow.table(decoded), names, [])


def _lines(file: IO[bytes], encoding: str, drop: int = 0) -> Iterator[bytes]:
    """Yield the lines of a text in UTF-8, many at a time; the last one ends, too.

    Texts in quotes that have several lines are not cut, if they are not longer than `_TEXT`.

    Args:
        file: File.
        encoding: Its encoding.
        drop: Number of lines that are left out at first.
    """
    plain = codecs.lookup(encoding).name in ("utf-8", "utf-8-sig")  # pyarrow checks it
    decoder, more = codecs.getincrementaldecoder(encoding)(), True
    rest = file.read(len(codecs.BOM_UTF8)).removeprefix(codecs.BOM_UTF8) if plain else b""
    while more:
        block = file.read(_BYTES)
        more = bool(block)
        rest += block if plain else decoder.decode(block, not more).encode()
        if len(rest) > _LONGEST:
            raise OverflowError(f"a line has more than {_LONGEST:,} bytes")
        cut = (rest.rfind(b"\n") + 1) if more else len(rest)
        back, quotes = cut, rest.count(b'"', 0, cut)
        while more and quotes % 2 and cut - back < _TEXT and back:
            line = rest.rfind(b"\n", 0, back - 1) + 1
            quotes, back = quotes - rest.count(b'"', line, back), line
        lines, rest = (rest[:back], rest[back:]) if quotes % 2 == 0 else (rest[:cut], rest[cut:])
        while drop and lines and (line_end := re.match(rb"[^\r\n]*(?:\r\n|\r|\n|$)", lines)):
            lines, drop = lines[line_end.end() :], drop - 1
        if lines:
            yield lines if lines.endswith((b"\n", b"\r")) else lines + b"\n"


def _is_deep(lines: bytes) -> bool:
    """Return whether more than `_DEPTH` arrays and objects are open at once, or are left open."""
    quoted = (
        lines.replace(b"\\\\", b"").replace(b'\\"', b"").translate(None, _BLAND).replace(b'""', b"")
    )
    marks = re.sub(rb'"[^"]*"', b"", quoted)
    for _ in range(_DEPTH):
        marks = marks.replace(b"{}", b"").replace(b"[]", b"")
    return len(marks) > _DEPTH


def _json_number(text: str) -> float | str:
    """Return a number, or its text if it is a time of more digits than a number keeps."""
    return text if _LONG.fullmatch(text.encode()) else float(text)


def _json_object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of JSON.

    Raises:
        ValueError: A name occurs twice.
    """
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = next(name for k, (name, _) in enumerate(pairs) if name in dict(pairs[:k]))
        raise ValueError(f"an object has {twice!r} twice")
    return found


def _json_text(value: Any) -> str | None:
    """Return a value of JSON as a text; whole numbers and truth without a point."""
    if value is None or (isinstance(value, float) and not value.is_integer()):
        return None if value is None else str(value)
    return str(int(value)) if isinstance(value, bool | float) else str(value)
