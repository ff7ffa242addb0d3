"""The dialect of a text file of ratings: encoding, separator, header and comments, as its beginning
shows them.
"""

import codecs
import csv
import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from roletrust_env.data.columns import are_common
from roletrust_env.data.units import is_date
from roletrust_env.parameters import truth_value

MARKS = ("#", "%")
"""What a line of comment begins with."""

_SEPARATORS = {
    "comma": ",",
    "tab": "\t",
    "semicolon": ";",
    "::": "::",
    "bar": "|",
    "blanks": " ",
}  # of equals, the first
_ONE = "\x1f"  # stands for a separator of several letters, which pyarrow does not know
_LINES = 200  # of the beginning
_WORDS = re.compile(rb'"[^"]*"|\S+')
_WINDOWS, _NO_WINDOWS = (
    re.compile(rb"[\x80-\x9f]"),
    re.compile(rb"[\x81\x8d\x8f\x90\x9d]"),
)  # letters of cp1252 only
_BYTE_ORDER = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",  # begins with the mark of UTF-16
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}


class Dialect(NamedTuple):
    """How a file is written. What is None is found, and the other parts hold.

    Attributes:
        separator: What stands between the columns of a text, one blank for any number of blanks; or
            its name: comma, tab, semicolon, bar or blanks.
        encoding: Encoding of a text, by its name in Python, such as `latin-1`.
        header: Whether the first row of a text has the names of the columns.
        unit: Unit of times that are numbers: `s`, `ms`, `us` or `ns`.
        time_format: Form of dates, as `datetime.strptime` has it, such as `%d.%m.%Y`.
    """

    separator: str | None = None
    encoding: str | None = None
    header: bool | None = None
    unit: str | None = None
    time_format: str | None = None


class Beginning(NamedTuple):
    """Facts that the beginning of a text shows.

    Attributes:
        separator: What stands between columns, see `Dialect`.
        header: Names of the columns; None without.
        width: Number of columns.
        lines: Number of lines before the first rating.
        comments: Whether the text begins with comments.
    """

    separator: str
    header: list[str] | None
    width: int
    lines: int
    comments: bool

    def __str__(self) -> str:
        """Return the separator and the header in words."""
        name = next(
            (name for name, one in _SEPARATORS.items() if one == self.separator),
            repr(self.separator),
        )
        return f"separator {name}, {'no header' if self.header is None else 'a header'}"


def find_encoding(head: bytes) -> str:
    """Return the encoding of a text by its first bytes: UTF-8, UTF-16 or UTF-32, else that of
    Windows or latin-1.

    Raises:
        ValueError: It is no text.
    """
    for mark, name in _BYTE_ORDER.items():
        if head.startswith(mark):
            return name
    even, odd = (head[side::2].count(0) / (len(head) // 2 + 1) for side in (0, 1))
    if max(even, odd) > 0.2 and min(even, odd) < 0.01:
        return "utf-16-be" if even > odd else "utf-16-le"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        if re.search(rb"[\x00-\x08\x0e-\x1a]", head):
            raise ValueError("its beginning is no text") from None
        if head.decode(
            "utf-8", "ignore"
        ).isascii():  # in UTF-8 with a fault, other letters would be right
            return "cp1252" if _WINDOWS.search(head) and not _NO_WINDOWS.search(head) else "latin-1"
    return "utf-8"


def find_separator(lines: list[str]) -> str:
    """Return the separator that cuts most rows into as many columns as the first; of equals, the
    comma.
    """
    for fewest in (3, 2):
        best, most = ",", 0.0
        for separator in _SEPARATORS.values():
            widths = [len(row) for row in _rows(lines, separator)]
            share = widths.count(widths[0]) / len(widths) if widths and widths[0] >= fewest else 0.0
            if share > most:
                best, most = separator, share
        if most:
            return best
    return ","


def look(
    head: str,
    dialect: Dialect,
    wanted: Iterable[str] = (),
    labels: Iterable[str] = (),
    marks: tuple[str, ...] = MARKS,
) -> Beginning:
    """Return what the beginning of a text shows.

    The first row is a header if it has the wanted names, or neither a number nor a date. Without a
    header of its own, a text has that in its last line of comment before the first rating, where
    this has as many columns and common names. A first line with a mark is no comment if it has
    numbers in the columns in which the first row has them.

    Args:
        head: Beginning of the text.
        dialect: Parts that are known.
        wanted: Names of columns.
        labels: Texts that are ratings, in small letters.
        marks: What a line of comment begins with.
    """
    lines = re.split("\r\n|\r|\n", head)
    if said := re.fullmatch("sep=(.)", lines[0].strip("\ufeff ")):  # Excel
        rest = look(
            head.partition("\n")[2],
            dialect._replace(separator=dialect.separator or said[1]),
            wanted,
            labels,
        )
        return rest._replace(lines=rest.lines + 1)
    full = [place for place, line in enumerate(lines) if line.strip()]
    data = [place for place in full if not lines[place].startswith(marks)][:_LINES]
    start = data[0] if data else len(lines)
    comments = [line.lstrip("".join(MARKS)).strip() for line in lines[:start] if line.strip()]
    rows = [lines[place] for place in data]
    separator = dialect.separator or find_separator(rows)
    separator = {**_SEPARATORS, "\\t": "\t"}.get(separator, separator)
    first = next(_rows(rows, separator), [])
    header = None if dialect.header is None else truth_value("header", dialect.header)
    numeric, marked = (
        [is_number(text) for text in row]
        for row in (first, next(_rows([lines[full[0]]], separator), []))
    )
    if comments and ((marked == numeric and any(numeric)) or not data):
        return look(head, dialect, wanted, labels, ())
    if header is None:
        values = (is_number(text) or is_date(text) or text.casefold() in labels for text in first)
        header = (bool(first) and set(first) >= set(wanted or [""])) or not any(values)
    if header:
        end = start + 1
        while "".join(lines[start:end]).count('"') % 2 and end < len(
            lines
        ):  # a name of several lines
            end += 1
        return Beginning(separator, first, len(first), end, bool(comments))
    named = next(_rows(comments[-1:], separator), [])
    fits = len(named) == len(first) and are_common(named)
    return Beginning(separator, named if fits else None, len(first), start, bool(comments))


def is_number(text: str) -> bool:
    """Return whether a text is a number, also one with a decimal comma."""
    try:
        return float(text.replace(",", ".", 1)) is not None
    except ValueError:
        return False


def delimiter(separator: str) -> str:
    """Return the one letter that stands between columns once `tidy` has been there."""
    return separator if len(separator) == 1 and separator != " " else _ONE


def tidy(lines: bytes, separator: str) -> bytes:
    """Return lines with one letter between columns, and without blanks between it and a quote."""
    if separator == " ":
        return (
            b"\n".join(_ONE.encode().join(_WORDS.findall(line)) for line in lines.splitlines())
            + b"\n"
        )
    one = delimiter(separator).encode()
    if one != separator.encode():
        lines = lines.replace(separator.encode(), one)
    return re.sub(b"(?<=" + re.escape(one) + rb') +(?=")', b"", lines) if b' "' in lines else lines


def _rows(lines: list[str], separator: str) -> Iterator[list[str]]:
    """Yield the rows of lines, each a list of texts without white space at their ends."""
    tidied = tidy("\n".join(lines).encode(), separator).decode().split("\n")
    return (
        [text.strip() for text in row]
        for row in csv.reader(tidied, delimiter=delimiter(separator))
        if row
    )
