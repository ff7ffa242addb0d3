"""Values in columns of pyarrow: names as codes, ratings as numbers, and times that stay exact."""

import re
import unicodedata
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.data.dates import dates_in_form, find_form, formatted_dates
from roletrust_env.data.units import UNITS, find_unit, has_zone, is_date, iso_dates, lost_digits
from roletrust_env.trust.key_index import Floats, Ints

_MISSING = ("na", "n/a", "nan", "nat", "null", "none", "-")
"""Texts that stand for no rating and no time, in small letters."""

_NO_ZONE = "dates without a time zone"  # they count as UTC
LONGEST = 10_000
"""Most bytes of a name, in UTF-8."""

_NUMBERED = "a name that is a number must be whole and below 2 ** 53, or a text"
_EXACT, _DIGITS = (
    2**53,
    15,
)  # whole numbers below, and numbers of so many digits, are exact as float64

Row = Callable[[int], str]
"""Function from a place in a column to the file and the row, for messages."""


def trimmed(name: str) -> str:
    """Return a name as it counts: composed (NFC) and without white space at its ends.

    So `ann` and `ann ` are one agent, and so are the two ways to write `é`, as one letter and with
    an accent.
    """
    return unicodedata.normalize("NFC", name.strip())


def _file(row: Row) -> str:
    return row(0).rpartition(", row")[0]


def is_missing(column: Any, *, value: bool = False) -> npt.NDArray[np.bool_]:
    """Return whether each value of a column is missing: null or blank, and if it is no name also
    `NA`.
    """
    import pyarrow as arrow
    from pyarrow import compute

    if is_text(column):
        texts = column.cast(arrow.string())
        gone = compute.or_(
            compute.utf8_is_space(texts), compute.equal(compute.binary_length(texts), 0)
        )
        if value:
            words = compute.utf8_lower(compute.utf8_trim_whitespace(texts))
            gone = compute.or_(gone, compute.is_in(words, arrow.array(_MISSING)))
        gone = compute.fill_null(gone, True)
    else:
        gone = compute.is_null(column, nan_is_null=True)
    flags: npt.NDArray[np.bool_] = to_numpy(gone.cast(arrow.uint8())).view(np.bool_)
    return flags


def is_text(column: Any) -> bool:
    """Return whether a column has texts."""
    import pyarrow.types as kinds

    return bool(
        kinds.is_string(column.type)
        or kinds.is_large_string(column.type)
        or kinds.is_string_view(column.type)
    )


def to_numpy(column: Any, missing: float = 0) -> Any:
    """Return numbers as an array; the column's own `to_numpy` imports pandas, which takes a quarter
    of a second.
    """
    import pyarrow as arrow

    if isinstance(column, arrow.ChunkedArray):
        column = column.combine_chunks()
    return np.from_dlpack(column.fill_null(missing) if column.null_count else column)


# --- names
# --------------------------------------------------------------------------------------------


def named(column: Any, what: str, row: Row) -> Any:
    """Return a column of names as texts.

    Names are texts; whole numbers, also as floats; or bytes, which are texts in UTF-8 or else
    hexadecimal.

    Args:
        column: Column.
        what: Its name, for messages.
        row: See `Row`.

    Raises:
        ValueError: The column has no names, or one is missing or very long.
    """
    import pyarrow as arrow
    from pyarrow import compute

    kinds = arrow.types
    if kinds.is_floating(column.type):
        column = _whole(column, what, row)
    elif kinds.is_decimal(column.type):
        if (
            wrong := np.flatnonzero(
                to_numpy(compute.not_equal(compute.trunc(column), column).cast(arrow.uint8()))
            )
        ).size:
            raise ValueError(f"{row(wrong[0])}: {what} is {column[int(wrong[0])]}; {_NUMBERED}")
        column = column.cast(arrow.decimal256(76, 0))
    elif (
        kinds.is_binary(column.type)
        or kinds.is_large_binary(column.type)
        or kinds.is_fixed_size_binary(column.type)
    ):
        codes = column.dictionary_encode()
        column = arrow.array(map(_byte_name, codes.dictionary.to_pylist()), arrow.string()).take(
            codes.indices
        )
    elif not (is_text(column) or kinds.is_integer(column.type) or kinds.is_null(column.type)):
        raise ValueError(
            f"{_file(row)}, {what} is of type {column.type}; names must be texts or whole numbers"
        )
    column = column.cast(arrow.string())
    if (missing := np.flatnonzero(is_missing(column))).size:
        raise ValueError(f"{row(missing[0])} has no name in {what}")
    sizes = to_numpy(compute.binary_length(column))
    if (long := np.flatnonzero(sizes > LONGEST)).size:
        size = sizes[long[0]]
        raise ValueError(
            f"{row(long[0])}: the name in {what} has {size:,} bytes; at most {LONGEST:,} are "
            "allowed"
        )
    return column


def _whole(column: Any, what: str, row: Row) -> Any:
    """Return floats as whole numbers; NaN is missing.

    Raises:
        ValueError: One is not whole, or too large to be exact.
    """
    import pyarrow as arrow

    numbers = to_numpy(column.cast(arrow.float64()), np.nan)
    missing = np.isnan(numbers)
    whole = np.where(missing, 0.0, numbers)
    if (wrong := np.flatnonzero((np.rint(whole) != whole) | (np.abs(whole) >= _EXACT))).size:
        raise ValueError(f"{row(wrong[0])}: {what} is {numbers[wrong[0]]!s}; {_NUMBERED}")
    return arrow.array(whole.astype(np.int64), mask=missing)


def _byte_name(name: bytes) -> str:
    """Return bytes as a name: the text in UTF-8, or else as hexadecimal number."""
    try:
        if trimmed(text := name.decode()).isprintable():
            return text
    except UnicodeDecodeError:
        pass
    return f"0x{name.hex()}"


# --- ratings
# ------------------------------------------------------------------------------------------


def numbers(
    column: Any,
    what: str,
    row: Row,
    *,
    comma: bool = False,
    labels: Mapping[str, float] | None = None,
) -> Floats:
    """Return a column as finite numbers.

    Args:
        column: Column.
        what: Its name, for messages.
        row: See `Row`.
        comma: Whether a number may have a comma in place of its point.
        labels: Numbers of texts, in small letters, in place of numbers.

    Raises:
        ValueError: The column has no numbers, or a number is missing, not finite or not among the
            labels.
    """
    import pyarrow as arrow

    dates = "a number or a date of ISO 8601, such as 2024-01-31; --time-format reads other dates"
    allowed = dates if what == "the time" else "a number"
    if labels:
        codes = column.cast(arrow.string()).dictionary_encode()
        values = np.array(
            [_label(text, labels) for text in codes.dictionary.to_pylist()] + [np.nan]
        )
        values, allowed = values[to_numpy(codes.indices, -1)], " or ".join(labels)
    else:
        values = _floats(column, what, row, comma)
    if (wrong := np.flatnonzero(~np.isfinite(values))).size:
        at = int(wrong[0])
        shown = (
            (column[at].as_py() or "")
            if is_text(column)
            else str(column[at] if labels else values[at])
        )
        hint = (
            "; --missing leaves such rows out"
            if shown.strip().casefold() in ("", *_MISSING)
            else ""
        )
        if re.search(r"\d[,.' ]\d{3}", shown):
            hint = " without separators of thousands"
        elif not hint and not labels and what != "the time":
            hint = "; --labels gives numbers to texts, such as yes=1,no=0"
        raise ValueError(f"{row(at)}: {what} is {shown!r}; it must be {allowed}{hint}")
    return values


def _label(text: str, labels: Mapping[str, float]) -> float:
    """Return the number of a text, in any case, or of a number, also written in another way; NaN if
    there is none.
    """
    key = text.strip().casefold()
    return labels[key] if key in labels else labels.get(f"{_number(key):g}", np.nan)


def _plain(column: Any, comma: bool) -> Any:
    """Return a column, and if it has texts these without white space at their ends and with a
    decimal point.
    """
    import pyarrow as arrow
    from pyarrow import compute

    if not is_text(column):
        return column
    column = compute.utf8_trim_whitespace(column.cast(arrow.string()))
    return compute.replace_substring(column, ",", ".", max_replacements=1) if comma else column


def _floats(column: Any, what: str, row: Row, comma: bool) -> Floats:
    """Return a column as numbers, with NaN where there is none."""
    import pyarrow as arrow

    column = _plain(column, comma)
    try:
        values: Floats = to_numpy(column.cast(arrow.float64(), safe=False), np.nan)
    except arrow.ArrowException:
        if not is_text(column):
            raise ValueError(
                f"{_file(row)}, {what} is of type {column.type}; it must be numbers"
            ) from None
        values = np.array([_number(text) for text in column.to_pylist()])
    return values


def _number(text: str | None) -> float:
    """Return the number in a text; NaN if there is none."""
    try:
        return float((text or "nan").replace("_", "x"))  # Python takes `1_0` for 10
    except ValueError:
        return float("nan")


# --- times
# --------------------------------------------------------------------------------------------


class Clock(NamedTuple):
    """Times of a log.

    Attributes:
        seconds: Seconds since 1970 where that is known, else the numbers that are there, shape
            (n,).
        exact: What orders times and tells them apart: whole numbers without rounding, or the
            seconds, shape (n,).
        rests: What the seconds do not hold of the times, see `lost_digits`, shape (n,); None if
            that is nothing.
        words: What the times were: `dates`, `dates without a time zone`, which count as UTC, both
            also with their form, `numbers in s` or in another unit, or `numbers`.
    """

    seconds: Floats
    exact: Ints | Floats
    rests: Floats | None
    words: str

    @property
    def kind(self) -> str:
        """Kind of values that are comparable: `numbers`, `dates without a time zone`, or `since
        1970`.
        """
        return next(
            (kind for kind in ("numbers", _NO_ZONE) if self.words.partition(", ")[0] == kind),
            "since 1970",
        )


class Times:
    """Times of a file, block by block: numbers, or dates, of one kind in all rows.

    Args:
        unit: Unit of numbers; None to find it by their size.
        time_format: Form of dates; None to find it.
    """

    def __init__(self, unit: str | None, time_format: str | None = None) -> None:
        if unit not in (None, *UNITS):
            raise ValueError(
                f"the unit of times is {unit!r}; it must be {', '.join(UNITS)} or nothing"
            )
        self._unit, self._format = unit, time_format
        self._form: str | None = None
        self._texts: list[
            tuple[Any, Row]
        ] = []  # dates in other forms than ISO 8601, of which the whole column decides
        self._zoned: bool | None = None
        self._dates = ""
        self._parts: list[
            tuple[Floats | Ints, Ints | None, int]
        ] = []  # seconds or numbers; whole numbers, and how many are 1

    def add(self, column: Any, row: Row, *, comma: bool = False) -> None:
        """Take a block; a number may have a comma in place of its point if `comma` says so.

        Raises:
            ValueError: There is something else than a time, or than times of the kind of the rows
                above.
        """
        import pyarrow as arrow
        import pyarrow.types as kinds

        if not (self._parts or self._texts or self._format) and is_text(column):
            if is_date(start := _iso(column[0].as_py())):
                self._zoned = has_zone(start)
                self._dates = "dates" if self._zoned else _NO_ZONE
            else:
                self._form = find_form(start)
        if self._format or self._form:
            self._texts.append((_plain(column.cast(arrow.string()), comma=False), row))
            return
        if self._zoned is not None:
            texts = column.cast(arrow.string()).to_pylist()
            ticks, unit = iso_dates(list(map(_iso, texts)), row, zoned=self._zoned)
            self._parts.append((ticks / UNITS[unit], ticks, UNITS[unit]))
        elif kinds.is_temporal(column.type) or kinds.is_boolean(column.type):
            self._dates = "dates" if getattr(column.type, "tz", None) else _NO_ZONE
            self._parts.append(_dates(column, row))
        else:
            floats, (whole, parts) = (
                numbers(column, "the time", row, comma=comma),
                _whole_ticks(column, comma),
            )
            self._parts.append(
                (floats if whole is None or parts > 1 else whole, whole, parts)
            )  # whole ones once

    def _row(self, place: int) -> str:
        """Return the file and the row of a date in another form than ISO 8601."""
        for texts, row in self._texts:
            if place < len(texts):
                return row(place)
            place -= len(texts)
        return ""

    def clock(self) -> Clock:
        """Return all times.

        Raises:
            ValueError: Dates are not of one form, or it is unclear which.
        """
        if self._texts:
            import pyarrow as arrow

            texts = arrow.concat_arrays([part for part, _ in self._texts])
            if self._format:
                ticks, zoned, form = formatted_dates(texts.to_pylist(), self._row, self._format)
            else:
                ticks, zoned, form = dates_in_form(texts, self._row, str(self._form))
            return Clock(ticks / UNITS["us"], ticks, None, ("dates" if zoned else _NO_ZONE) + form)
        floats = np.concatenate([part[0] for part in self._parts], dtype=np.float64)
        exact = _same_unit([(ticks, scale) for _, ticks, scale in self._parts])
        unit = None if self._dates else self._unit or find_unit(floats)
        words = self._dates or (f"numbers in {unit}" if unit else "numbers")
        scale = UNITS[unit or "s"]
        seconds = floats if scale == 1 else floats / scale
        if exact is None:
            return Clock(seconds, floats, None, words)
        rests = lost_digits(seconds, exact, scale * max(part[2] for part in self._parts))
        return Clock(seconds, exact, rests if rests.any() else None, words)


def _iso(text: str | None) -> str:
    """Return a date as ISO 8601 has it, without white space at its ends, and `Z` for ` UTC`."""
    text = (text or "").strip()
    return f"{text[:-4]}Z" if text.endswith(" UTC") else text


def _dates(column: Any, row: Row) -> tuple[Floats, Ints, int]:
    """Return dates of pyarrow as seconds since 1970, as whole numbers of their unit, and how many
    are a second.
    """
    import pyarrow as arrow

    kind = arrow.types
    if not (kind.is_timestamp(column.type) or kind.is_date(column.type)):
        raise ValueError(
            f"{_file(row)}, the time is of type {column.type}; it must be a date or numbers"
        )
    if column.null_count:
        at = int(np.flatnonzero(is_missing(column))[0])
        raise ValueError(f"{row(at)}: the time is 'nan'; it must be a date")
    ticks = to_numpy(
        column.cast(arrow.int32() if kind.is_date32(column.type) else arrow.int64())
    ).astype(np.int64)
    if kind.is_date32(column.type):
        ticks *= 86400
    scale = (
        UNITS[column.type.unit]
        if kind.is_timestamp(column.type)
        else 1
        if kind.is_date32(column.type)
        else 1000
    )
    return ticks / scale, ticks, scale


def _whole_ticks(column: Any, comma: bool) -> tuple[Ints | None, int]:
    """Return numbers exactly, as whole numbers and how many are 1, a power of 1000; None where that
    is not possible.
    """
    import pyarrow as arrow
    from pyarrow import compute

    column = _plain(column, comma)
    if (
        not is_text(column)
        and not arrow.types.is_integer(column.type)
        and not arrow.types.is_decimal(column.type)
    ):
        return None, 1
    try:
        return to_numpy(column.cast(arrow.int64())), 1
    except arrow.ArrowException:
        if (
            is_text(column)
            and (compute.max(compute.binary_length(column)).as_py() or 0) <= _DIGITS + 1
        ):
            return None, 1  # floats tell them apart
    for digits in (0, 3, 6, 9):
        try:
            decimals = column.cast(arrow.decimal128(min(19 + digits, 27), digits))
            parts = compute.multiply(
                decimals, arrow.scalar(10**digits, arrow.decimal128(digits + 1, 0))
            )
            return to_numpy(parts.cast(arrow.decimal128(38, 0)).cast(arrow.int64())), 10**digits
        except arrow.ArrowException:  # more digits are needed, or there are too many
            continue
    return None, 1


def _same_unit(parts: list[tuple[Ints | None, int]]) -> Ints | None:
    """Return whole numbers of several units in the smallest of these; None where one is missing or
    too large.
    """
    smallest = max(scale for _, scale in parts)
    found = []
    for ticks, scale in parts:
        factor = smallest // scale
        if ticks is None or (factor > 1 and np.abs(ticks).max(initial=0) > 2**63 // factor - 1):
            return None
        found.append(ticks * factor if factor > 1 else ticks)
    return np.concatenate(found)
