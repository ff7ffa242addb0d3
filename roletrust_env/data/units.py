"""Units of a log: ratings on a scale, and times as seconds since 1970 where they are dates."""

import re
import warnings
from collections.abc import Callable
from numbers import Real
from typing import Any

import numpy as np

from roletrust_env.trust.key_index import Floats, Ints

_ZONE = re.compile(r"(?:Z|[+-]\d\d(?::?\d\d)?)$")
_DAY, _MICRO = len("2024-01-31"), len("2024-01-31T12:00:00.000000")

UNITS = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}
"""How many of a unit of time are a second."""


def check_scale(scale: tuple[float, float]) -> None:
    """Refuse a scale whose best rating is not above its worst.

    Raises:
        ValueError: The scale is no pair of numbers, is empty or not finite.
    """
    if not (
        isinstance(scale, tuple | list | np.ndarray)
        and len(scale) == 2
        and all(isinstance(end, Real) for end in scale)
    ):
        raise ValueError(
            f"the scale is {scale!r}; it must be the worst and the best rating, two numbers"
        )
    if not -np.inf < scale[0] < scale[1] < np.inf:
        raise ValueError(
            f"the scale is from {scale[0]:g} to {scale[1]:g}; the best rating must be above the "
            "worst"
        )
    if not float(scale[1]) - float(scale[0]) < np.inf:
        raise ValueError(f"the scale from {scale[0]:g} to {scale[1]:g} is too wide for a number")


def unit_ratings(
    ratings: Floats,
    scale: tuple[float, float],
    name: Callable[[int], str] = lambda at: f"rating {at + 1} is",
) -> Floats:
    """Return ratings on [0, 1], 0 for the worst.

    Args:
        ratings: Ratings, shape (n,).
        scale: Worst and best rating.
        name: Function from a place among the ratings to the beginning of an error message.

    Raises:
        ValueError: A rating is not a number or is off the scale. The message names the first one.
    """
    worst, best = scale
    if not (right := (ratings >= worst) & (ratings <= best)).all():
        at = int(right.argmin())
        raise ValueError(
            f"{name(at)} {number_text(ratings[at])}, off the scale from {worst:g} to {best:g}"
        )
    unit = ratings - worst
    unit /= best - worst
    return unit


def number_text(number: Any) -> str:
    """Return a number with all its digits, and a whole one without a point."""
    return repr(float(number)).removesuffix(".0")


def date_seconds(dates: Any) -> Floats:
    """Return dates of NumPy, of any unit, as seconds since 1970; NaN for a missing one."""
    return np.asarray((dates - np.datetime64(0, "s")) / np.timedelta64(1, "s"), np.float64)


def lost_digits(times: Floats, ticks: Ints, scale: int) -> Floats:
    """Return what float64 does not hold of times, shape (n,): with it, times are told apart to the
    last digit.

    Args:
        times: Times as float64, shape (n,).
        ticks: The same times as whole numbers, shape (n,).
        scale: Number of ticks in 1 of `times`.

    Returns:
        Ticks after the last whole microsecond; without a unit, what rounding added to whole
        numbers.
    """
    if scale > 10**6:
        return (ticks % (scale // 10**6)).astype(np.float64)
    fits = (np.abs(times) < 2.0**63) & (scale == 1)
    return np.where(fits, ticks - np.where(fits, times, 0.0).astype(np.int64), 0).astype(np.float64)


def is_date(text: str) -> bool:
    """Return whether a text is a date of ISO 8601; NumPy also takes years, `today`, `now`, and
    nothing for one.
    """
    try:
        return "-" in text[1:] and not np.isnat(_dates(text))
    except ValueError:
        return False


def has_zone(text: str) -> bool:
    """Return whether a date of ISO 8601 ends with a time zone, such as `Z` or `+02:00`."""
    return _ZONE.search(text, _DAY) is not None


def iso_dates(texts: list[str], row: Callable[[int], str], *, zoned: bool) -> tuple[Ints, str]:
    """Return dates and times of ISO 8601 as whole numbers since 1970 in UTC, and their unit: `us`,
    or `ns` if need be.

    Args:
        texts: Dates, all with a time zone or all without.
        row: Function from a place to the file and the row, for messages.
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
            f"{row(wrong)}: the time is {texts[wrong]!r}; it must be a date of ISO 8601, as in the "
            "rows above"
        )
    other = next((at for at, text in enumerate(texts) if has_zone(text) != zoned), None)
    if other is not None:
        has, have = ("no time zone", "one") if zoned else ("a time zone", "none")
        raise ValueError(
            f"{row(other)}: the time {texts[other]!r} has {has}, and the rows above have {have}"
        )
    unit = "ns" if np.datetime_data(dates.dtype)[0] in ("ns", "ps", "fs", "as") else "us"
    return dates.astype(f"datetime64[{unit}]").astype(np.int64), unit


def _dates(texts: str | list[str]) -> Any:
    """Return dates of NumPy in UTC, in microseconds or finer; NumPy warns that it does not keep
    time zones.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        fine = not isinstance(texts, str) and max(map(len, texts)) > _MICRO
        return np.array(texts, "datetime64" if fine else "datetime64[us]")


def find_unit(times: Floats) -> str | None:
    """Return the unit of times since 1970 by their size: `s`, `ms`, `us` or `ns`; None where one is
    before 1973.

    The largest decides: from 10 ** 11 on, seconds would be after the year 5000, and milliseconds
    are after 1973.
    """
    largest = np.abs(times).max(initial=0.0)
    if largest < 1e11:
        return "s" if len(times) and times.min() >= 1e8 else None
    return "ms" if largest < 1e14 else "us" if largest < 1e17 else "ns"
