"""Dates and times as seconds since 1970."""

import re
import warnings
from typing import Any

import numpy as np

from roletrust_env.trust.ledger import Floats

_ZONE = re.compile(r"(?:Z|[+-]\d\d(?::?\d\d)?)$")
_DAY = 10  # letters of a date without a time


def date_seconds(dates: Any) -> Floats:
    """Return dates of NumPy, of any unit, as seconds since 1970; NaN for a missing one."""
    return np.asarray((dates - np.datetime64(0, "s")) / np.timedelta64(1, "s"), np.float64)


def is_date(text: str) -> bool:
    """Return whether a text is a date of ISO 8601; NumPy also takes years, `today`, `now`, and nothing for one."""
    try:
        return "-" in text[1:] and not np.isnat(_dates(text))
    except ValueError:
        return False


def has_zone(text: str) -> bool:
    """Return whether a date of ISO 8601 ends with a time zone, such as `Z` or `+02:00`."""
    return _ZONE.search(text, _DAY) is not None


def text_seconds(texts: list[str], what: str, row: str, first: int, *, zoned: bool) -> Floats:
    """Return dates and times of ISO 8601 as seconds since 1970.

    Args:
        texts: Dates, all with a time zone or all without.
        what: Name of the column, for error messages.
        row: Name of the file and of a row, for error messages.
        first: Number of the first row.
        zoned: Whether the dates have a time zone.

    Raises:
        ValueError: A text is no date, or differs from `zoned`. The message names the row.
    """
    try:
        dates = _dates(texts) if all("-" in text[1:] for text in texts) else None
    except ValueError:
        dates = None
    if dates is None:
        wrong = next(at for at, text in enumerate(texts) if not is_date(text))
        raise ValueError(
            f"{row} {first + wrong}: {what} is {texts[wrong]!r}; it must be a date of ISO 8601, as in the rows above"
        )
    other = next((at for at, text in enumerate(texts) if has_zone(text) != zoned), None)
    if other is not None:
        has, have = ("no time zone", "one") if zoned else ("a time zone", "none")
        raise ValueError(f"{row} {first + other}: {what} {texts[other]!r} has {has}, and the rows above have {have}")
    return date_seconds(dates)


def _dates(texts: str | list[str]) -> Any:
    """Return dates of NumPy in UTC, in microseconds; NumPy warns that it does not keep time zones."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return np.array(texts, "datetime64[us]")
