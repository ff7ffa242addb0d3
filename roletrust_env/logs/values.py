"""Columns of pyarrow as arrays: names, ratings on a scale, and times in nanoseconds."""

import re
import unicodedata
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.logs.sources import Reading
from roletrust_env.trust.key_index import Floats, Ints

LONGEST = 10_000
"""Most bytes of a name, in UTF-8."""

_EXACT = 2**53
"""Whole numbers below are exact as float64."""

_NUMBER = r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"
_NANOSECONDS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
_DATE = "2024-01-31T12:00:00Z"
_LATEST = 2**63 - 1
_SWAPPED = str.maketrans(",.", ".,")

Row = Callable[[int], str]
"""Function from a position in a column to the source and the row, for error messages."""


def trimmed(name: str) -> str:
    """Return a name as it counts: composed (NFC) and without white space at its ends.

    So `ann` and `ann ` are one agent, and so are the two ways to write `é`, as one letter and with
    an accent.
    """
    return unicodedata.normalize("NFC", name.strip())


def is_missing(column: Any, missing: tuple[str, ...]) -> npt.NDArray[np.bool_]:
    """Return whether each value of a column is null or NaN, or one of some texts."""
    import pyarrow as arrow
    from pyarrow import compute

    gone = compute.is_null(column, nan_is_null=True)
    texts = [text.strip() for text in missing]
    if texts and is_text(column):
        trimmed_texts = compute.utf8_trim_whitespace(column)
        gone = compute.or_(gone, compute.is_in(trimmed_texts, arrow.array(texts, arrow.string())))
    elif numbers := [float(text) for text in texts if re.fullmatch(_NUMBER, text)]:
        kinds = arrow.types
        if kinds.is_integer(column.type) or kinds.is_floating(column.type):
            values = column.cast(arrow.float64(), safe=False)
            gone = compute.or_(gone, compute.is_in(values, arrow.array(numbers)))
    flags: npt.NDArray[np.bool_] = compute.fill_null(gone, True).to_numpy()
    return flags


def is_text(column: Any) -> bool:
    """Return whether a column of pyarrow has texts."""
    import pyarrow as arrow

    return bool(arrow.types.is_string(column.type))


def plain_column(column: Any) -> Any:
    """Return a column of pyarrow without codes, and with texts of the type `string`."""
    import pyarrow as arrow

    kinds = arrow.types
    if (
        kinds.is_dictionary(column.type) and column.num_chunks
    ):  # a library may have codes that cannot be cast
        chunks = [(plain_column(chunk.dictionary), chunk.indices) for chunk in column.chunks]
        column = arrow.chunked_array([values.take(codes) for values, codes in chunks])
    kind = column.type
    texts = kinds.is_string(kind) or kinds.is_large_string(kind) or kinds.is_string_view(kind)
    return column.cast(arrow.string()) if texts else column


def name_codes(columns: list[Any], what: list[str], row: Row) -> tuple[Any, list[Ints]]:
    """Return the names in columns, in the order in which they first occur, and the position of each
    value among them.

    Args:
        columns: Columns of names, which share them: texts, or whole numbers.
        what: Name of each column, for error messages.
        row: See `Row`.

    Returns:
        The names, a column of texts; and an array of positions for each column.

    Raises:
        ValueError: A column does not hold names, or a name is missing, is too long or contains a
            byte order mark.
    """
    import pyarrow as arrow
    from pyarrow import compute

    texts = [_name_texts(column, name, row) for column, name in zip(columns, what, strict=True)]
    chunks = [chunk for column in texts for chunk in column.chunks]
    coded = _dictionary(arrow.chunked_array(chunks, arrow.string()))
    names, codes = coded.dictionary, coded.indices.to_numpy().astype(np.int64)
    clean = compute.utf8_normalize(compute.utf8_trim_whitespace(names), form="NFC")
    _check_names(clean, codes, [len(column) for column in columns], what, row)
    if not clean.equals(names):
        joined = clean.dictionary_encode()
        names, codes = joined.dictionary, joined.indices.to_numpy().astype(np.int64)[codes]
    ends = np.cumsum([len(column) for column in columns])
    return names, np.split(codes, ends[:-1])


def _dictionary(texts: Any) -> Any:
    """Return a column of texts as one array of positions among its different texts."""
    import pyarrow as arrow

    coded = texts.dictionary_encode().unify_dictionaries().combine_chunks()
    return arrow.concat_arrays(coded.chunks) if isinstance(coded, arrow.ChunkedArray) else coded


def _name_texts(column: Any, what: str, row: Row) -> Any:
    """Return a column of names as texts."""
    import pyarrow as arrow

    kinds = arrow.types
    if kinds.is_floating(column.type):
        numbers = column.to_numpy()
        wrong = ~((np.rint(numbers) == numbers) & (np.abs(numbers) < _EXACT))
        if wrong.any():
            at = int(wrong.argmax())
            raise ValueError(f"{row(at)}: the {what} is {numbers[at]}; a number must be whole")
        column = arrow.chunked_array([numbers.astype(np.int64)])
    elif not (is_text(column) or kinds.is_integer(column.type) or kinds.is_null(column.type)):
        raise ValueError(f"{row(0)}: the {what} is of type {column.type}; it must be a name")
    if column.null_count:
        at = int(np.flatnonzero(is_missing(column, ()))[0])
        raise ValueError(f"{row(at)}: the {what} is missing; missing=[...] leaves out such rows")
    return column.cast(arrow.string())


def _check_names(names: Any, codes: Ints, sizes: list[int], what: list[str], row: Row) -> None:
    """Refuse names that are empty, too long, or contain a byte order mark."""
    from pyarrow import compute

    length = compute.binary_length(names).to_numpy()
    marked = compute.match_substring_regex(names, "[\ufeff\0]").to_numpy(zero_copy_only=False)
    wrong = (length == 0) | (length > LONGEST) | marked
    if not wrong.any():
        return
    at = int(np.flatnonzero(wrong[codes])[0])
    side = int(np.searchsorted(np.cumsum(sizes), at, side="right"))
    name = names[int(codes[at])].as_py()
    why = "is missing"
    if name:
        why = f"has {len(name.encode()):,} bytes; at most {LONGEST:,} are allowed"
    if set(name) & {"\ufeff", "\0"}:
        why = f"is {name!r}, with a byte order mark or a NUL: files were joined, or it is no text"
    raise ValueError(f"{row(at - sum(sizes[:side]))}: the {what[side]} {why}")


def rating_numbers(column: Any, reading: Reading, row: Row) -> Floats:
    """Return a column of ratings as finite numbers, not yet on a scale.

    Raises:
        ValueError: A rating is missing, or is neither a number nor a label.
    """
    import pyarrow as arrow
    from pyarrow import compute

    kinds = arrow.types
    if kinds.is_boolean(column.type) or (reading.labels and kinds.is_integer(column.type)):
        column = column.cast(arrow.string())
    if is_text(column):
        texts = compute.utf8_trim_whitespace(column)
        numbers = _text_numbers(texts, reading)
    elif (
        kinds.is_integer(column.type)
        or kinds.is_floating(column.type)
        or kinds.is_decimal(column.type)
    ):
        numbers = column.cast(arrow.float64(), safe=False).to_numpy()
    else:
        raise ValueError(f"{row(0)}: the rating is of type {column.type}; it must be a number")
    if not (finite := np.isfinite(numbers)).all():
        at = int(finite.argmin())
        label = f" or one of {', '.join(reading.labels)}" if reading.labels else ""
        raise ValueError(
            f"{row(at)}: the rating is {column[at].as_py()!r}; it must be a number with the "
            f"decimal mark {reading.decimal!r}{label}; decimal=, and labels={{...}} state others"
        )
    return np.asarray(numbers, np.float64)


def _text_numbers(texts: Any, reading: Reading) -> Floats:
    """Return texts as numbers; NaN where a text is none."""
    import pyarrow as arrow
    from pyarrow import compute

    if reading.decimal == "." and not reading.labels:
        try:
            plain: Floats = texts.cast(arrow.float64()).to_numpy()
            return plain
        except arrow.ArrowInvalid:  # the slower way finds the row
            pass
    codes = _dictionary(texts)
    known: Mapping[str, float] = {
        trimmed(text).casefold(): value for text, value in reading.labels.items()
    }
    numbers = np.array(
        [_number(text, reading.decimal, known) for text in codes.dictionary.to_pylist()]
        + [np.nan]  # of a null, whose index is the last one
    )
    found: Floats = numbers[compute.fill_null(codes.indices, -1).to_numpy()]
    return found


def _number(text: str, decimal: str, labels: Mapping[str, float]) -> float:
    if text is not None and (label := labels.get(trimmed(text).casefold())) is not None:
        return float(label)
    plain = text.translate(_SWAPPED) if decimal == "," else text
    return float(plain) if re.fullmatch(_NUMBER, plain) else float("nan")


def time_nanoseconds(column: Any, reading: Reading, row: Row) -> Ints:
    """Return a column of times in nanoseconds, since 1970 where they are dates.

    Dates without a time zone are in UTC. Numbers are in the unit of `Reading.time_unit`.

    Raises:
        ValueError: A time is missing, is of another form than the first one, or is too far from
            1970.
    """
    import pyarrow as arrow
    from pyarrow import compute

    kinds, factor = arrow.types, _NANOSECONDS[reading.time_unit]
    form = reading.time_format
    if form is not None and kinds.is_integer(column.type):
        column = column.cast(arrow.string())
    elif form is not None and not is_text(column):
        raise ValueError(f"{row(0)}: the time is of type {column.type}; time_format is for texts")
    if kinds.is_temporal(column.type) and not kinds.is_time(column.type):
        return _parsed(column, _dates(None), row)
    if kinds.is_integer(column.type):
        numbers, most = column.to_numpy(), _LATEST // factor
        ends = int(numbers.min(initial=0)), int(numbers.max(initial=0))
        if not column.null_count and -most <= ends[0] and ends[1] <= most:
            _refuse_dates(numbers, row)
            return np.asarray(numbers, np.int64) * factor
        column = column.cast(arrow.decimal128(38, 0))
    if kinds.is_floating(column.type):
        return _parsed(column, _float_times(factor), row)
    if kinds.is_decimal(column.type):
        return _parsed(column, _decimals(factor), row)
    if not is_text(column):
        raise ValueError(f"{row(0)}: the time is of type {column.type}; it must be a time")
    column = compute.utf8_trim_whitespace(column)
    if form is not None:
        return _parsed(column, _formatted(form), row, f"of the form {form}")
    dates, zoned = _dates(None), _dates("UTC")
    for parse in (dates, zoned, _decimals(factor, reading.decimal)):
        try:
            parse(column.slice(0, 1))
        except arrow.ArrowException:
            continue
        times = _parsed(column, parse, row)
        if parse is not dates and parse is not zoned:
            _refuse_dates(times // factor, row)
        return times
    raise ValueError(
        f"{row(0)}: the time is {column[0].as_py()!r}; it must be a date of ISO 8601 such as "
        f"{_DATE}, or a number in {reading.time_unit} within 292 years of 1970; time_format and "
        "time_unit state other forms and units"
    )


def _refuse_dates(numbers: Ints, row: Row) -> None:
    """Refuse numbers that all look like dates, such as 20240131."""
    months, days = numbers // 100 % 100, numbers % 100
    likely = (numbers >= 19000101) & (numbers <= 21001231) & (months >= 1) & (months <= 12)
    if len(numbers) and (likely & (days >= 1) & (days <= 31)).all():
        raise ValueError(
            f"{row(0)}: the time is {numbers[0]}, and all times look like dates; "
            "time_format=%Y%m%d reads them"
        )


Parse = Callable[[Any], Any]


def _dates(zone: str | None) -> Parse:
    """Return a function from dates to nanoseconds."""
    import pyarrow as arrow

    def parse(part: Any) -> Any:
        same = getattr(part.type, "tz", None) if arrow.types.is_timestamp(part.type) else zone
        return part.cast(arrow.timestamp("ns", same)).cast(arrow.int64())

    return parse


def _formatted(form: str) -> Parse:
    """Return a function from texts of a form to nanoseconds, see `datetime.strptime`."""
    import pyarrow as arrow

    epoch, microsecond = datetime(1970, 1, 1, tzinfo=UTC), timedelta(microseconds=1)

    def nanoseconds(text: str) -> int:
        moment = datetime.strptime(text, form)
        moment = moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment
        return (moment - epoch) // microsecond * 1000

    def parse(part: Any) -> Any:
        return arrow.array([nanoseconds(text) for text in part.to_pylist()], arrow.int64())

    return parse


def _decimals(factor: int, decimal: str = ".") -> Parse:
    """Return a function from decimals, also as texts, to nanoseconds; seconds are rounded to the
    microsecond, as they are where they are floats.
    """
    import pyarrow as arrow
    from pyarrow import compute

    def parse(part: Any) -> Any:
        if is_text(part):
            if decimal == ",":
                part = compute.replace_substring(part, ".", "?")
                part = compute.replace_substring(part, ",", ".")
            part = compute.replace_substring_regex(part, r"(\.\d{9})\d+$", r"\1")
        if factor > 1:
            part = part.cast(arrow.decimal128(25, 9))
            part = compute.multiply(part, arrow.scalar(factor, arrow.decimal128(10, 0)))
        else:
            part = part.cast(arrow.decimal128(28, 9))
        digits = -3 if factor == _NANOSECONDS["s"] else 0
        return compute.round(part, ndigits=digits).cast(arrow.int64())

    return parse


def _float_times(factor: int) -> Parse:
    """Return a function from floats to nanoseconds, which are rounded to the microsecond."""
    import pyarrow as arrow

    def parse(part: Any) -> Any:
        return arrow.array(seconds_to_nanoseconds(part.to_numpy() * (factor / 10**9)))

    return parse


def seconds_to_nanoseconds(seconds: Floats | Ints) -> Ints:
    """Return seconds in nanoseconds; decimals are rounded to the microsecond.

    Raises:
        ValueError: A time is not finite, or is more than 292 years from 1970.
    """
    if not (right := np.abs(seconds.astype(np.float64)) < 2**63 / 10**9).all():
        at = int(right.argmin())
        raise ValueError(
            f"times have {seconds[at]} at position {at + 1}; they must be seconds within 292 years "
            "of 1970"
        )
    if seconds.dtype.kind == "f":
        rounded: Ints = np.rint(seconds.astype(np.float64) * 10**6).astype(np.int64) * 1000
        return rounded
    return seconds.astype(np.int64) * 10**9


def _parsed(
    column: Any, parse: Parse, row: Row, form: str = "of the same form as the first one"
) -> Ints:
    """Return a whole column as nanoseconds; an error names the first row that cannot be read."""
    import pyarrow as arrow

    errors = arrow.ArrowException, ValueError, OverflowError
    try:
        found = parse(column)
        if not found.null_count:
            times: Ints = np.asarray(found.to_numpy(), np.int64)
            return times
        at = int(np.flatnonzero(is_missing(column, ()))[0])
    except errors:
        low, high = 0, len(column)  # the first failure is at low or later, before high
        while high - low > 1:
            middle = (low + high) // 2
            try:
                parse(column.slice(low, middle - low))
                low = middle
            except errors:
                high = middle
        at = low
    try:
        time = repr(column[at].as_py())
    except OverflowError:
        time = "out of range"
    raise ValueError(
        f"{row(at)}: the time is {time}; it must be a time {form}, within 292 years of 1970"
    )
