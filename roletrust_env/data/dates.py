"""Dates in other forms than ISO 8601, such as 31.01.2024, 01/31/2024 and Jan 31, 2024, of one
column.
"""

import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from roletrust_env.trust.key_index import Ints

_MONTHS = [
    *("january", "february", "march", "april", "may", "june", "july", "august", "september"),
    *("october", "november", "december"),
]
_WEEKDAY = r"(?:[A-Za-z]{3,9}\.?,? +)?"
_FORMS = (
    r"(?P<day>\d{1,2})(?P<mark>[./-])(?P<month>\d{1,2})[./-](?P<year>\d{4})",  # or the month first
    r"(?P<year>\d{4})[./-](?P<month>\d{1,2})[./-](?P<day>\d{1,2})",
    rf"{_WEEKDAY}(?P<day>\d{{1,2}})[ -](?P<month>[A-Za-z]{{3,9}})\.?,?[ -](?P<year>\d{{4}})",
    rf"{_WEEKDAY}(?P<month>[A-Za-z]{{3,9}})\.? +(?P<day>\d{{1,2}}),? +(?P<year>\d{{4}})",
)
_CLOCK = (
    r"(?:,?[ T]+(?P<hour>\d{1,2}):(?P<minute>\d\d)(?::(?P<second>\d\d(?:\.\d{1,6})?))? ?(?P<half>[AaPp][Mm])?)?"  # noqa: E501
    r"(?: ?(?P<zone>Z|UTC|GMT|[+-]\d\d:?\d\d))?"
)


_S = 1_000_000  # microseconds
_NO_ZONE = 1 << 40


def find_form(text: str) -> str | None:
    """Return the regular expression of the form of a date; None if it has none of the known
    ones.
    """
    return next((form + _CLOCK for form in _FORMS if re.fullmatch(form + _CLOCK, text)), None)


def dates_in_form(texts: Any, row: Callable[[int], str], form: str) -> tuple[Ints, bool, str]:
    """Return dates as microseconds since 1970, shape (n,), whether they have a time zone, and their
    order in words.

    Without a time zone they are in UTC. Of two numbers before the year, the first is the day if a
    point stands between them; else the whole column decides, since the day is above 12 somewhere.

    Args:
        texts: Dates without white space at their ends, an array of pyarrow.
        row: Function from a place to the file and the row, for messages.
        form: Regular expression, see `find_form`.

    Raises:
        ValueError: A text is no date in this form, or day and month could be either. The message
            names the row.
    """
    from pyarrow import compute

    parts = compute.extract_regex(texts, pattern=f"^{form}$")
    groups = [field.name for field in parts.type]

    def group(name: str, function: Callable[[str], Any]) -> Any:
        """Return a function of the text of a group, for each date."""
        codes = compute.fill_null(
            compute.struct_field(parts, groups.index(name)), ""
        ).dictionary_encode()
        return np.array([function(text) for text in codes.dictionary.to_pylist()])[
            np.from_dlpack(codes.indices)
        ]

    day, month, year, hour, minute = (
        group(name, _number) for name in ("day", "month", "year", "hour", "minute")
    )
    second, half, zone, words = (
        group("second", _micro),
        group("half", str.lower),
        group("zone", _offset),
        "",
    )
    if "mark" in groups:
        month_first = not ((day > 12) | group("mark", ".".__eq__)).any()
        if month_first and (day != month).any() and not (month > 12).any():
            file, example = (
                row(0).rpartition(", row")[0],
                texts[int((day != month).argmax())].as_py(),
            )
            either = " or ".join(
                f"--time-format '{_format(example, order)}'" for order in ("dm", "md")
            )
            raise ValueError(
                f"{file}: in {example!r} the day or the month may be first; {either} says which"
            )
        day, month = (month, day) if month_first else (day, month)
        words = f", the {'month' if month_first else 'day'} first"
    months = ((year - 1970) * 12 + month - 1).astype("datetime64[M]")
    days = months.astype("datetime64[D]") + (day - 1)
    right = (
        (month >= 1)
        & (month <= 12)
        & (days.astype("datetime64[M]") == months)
        & (minute < 60)
        & (second < 60 * _S)
    )
    right &= np.where(half == "", hour < 24, (hour >= 1) & (hour <= 12)) & (
        (zone == _NO_ZONE) == (zone[0] == _NO_ZONE)
    )
    if not right.all():
        at = int(right.argmin())
        hint = "it must be a date in the form of the first row; --time-format names another form"
        raise ValueError(f"{row(at)}: the time is {texts[at].as_py()!r}; {hint}")
    hour = np.where(half == "", hour, hour % 12 + 12 * (half == "pm"))
    seconds = (
        days.astype(np.int64) * 86_400
        + hour * 3600
        + minute * 60
        - np.where(zone == _NO_ZONE, 0, zone)
    )
    return seconds * _S + second, bool(zone[0] != _NO_ZONE), words


def formatted_dates(
    texts: list[str], row: Callable[[int], str], time_format: str
) -> tuple[Ints, bool, str]:
    """Return dates as microseconds since 1970, shape (n,), whether they have a time zone, and their
    form in words.

    Without a time zone they are in UTC.

    Args:
        texts: Dates.
        row: Function from a place to the file and the row, for messages.
        time_format: Form of the dates, see `datetime.strptime`.

    Raises:
        ValueError: A text is no date in this form. The message names the row.
    """
    found, start = dict[str, int](), datetime(1970, 1, 1, tzinfo=UTC)
    for at, text in enumerate(texts):
        if text not in found:
            try:
                date = datetime.strptime(text, time_format)
            except (ValueError, re.error) as error:
                raise ValueError(f"{row(at)}: {error} (--time-format)") from None
            found[text] = (
                (date if date.tzinfo else date.replace(tzinfo=UTC)) - start
            ) // timedelta(microseconds=1)
    return (
        np.array([found[text] for text in texts], np.int64),
        "%z" in time_format,
        f", as {time_format}",
    )


def _number(text: str) -> int:
    """Return a number, or that of a month by the beginning of its name; 0 if it is neither."""
    if text.isdecimal():
        return int(text)
    return next(
        (place for place, name in enumerate(_MONTHS, 1) if text and name.startswith(text.lower())),
        0,
    )


def _micro(text: str) -> int:
    whole, _, part = text.partition(".")
    return int(whole or 0) * _S + int(part.ljust(6, "0") or 0)


def _offset(zone: str) -> int:
    """Return the distance of a time zone from UTC, seconds."""
    if zone[:1] not in ("+", "-"):
        return 0 if zone else _NO_ZONE
    return int(f"{zone[0]}1") * (int(zone[1:3]) * 3600 + int(zone[-2:]) * 60)


def _format(text: str, order: str) -> str:
    """Return the form of a date with the day and the month in an order, as `datetime.strptime` has
    it.
    """
    hour = "%I" if re.search("[AaPp][Mm]", text) else "%H"
    for pattern, code in (
        (r"^\d+([./-])\d+[./-]\d{4}", rf"%{order[0]}\1%{order[1]}\1%Y"),
        (r"(Z|UTC|GMT|[+-]\d\d:?\d\d)$", "%z"),
        (r"\d+:\d\d", f"{hour}:%M"),
        (r":\d\d", ":%S"),
        (r"\.\d+", ".%f"),
        (r"[AaPp][Mm]", "%p"),
    ):
        text = re.sub(pattern, code, text, count=1)
    return text
