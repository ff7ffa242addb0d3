"""Units of a log: ratings on a scale, and times as seconds since 1970 where they are dates."""

import re
import warnings
from collections.abc import Callable
from numbers import Real
from typing import Any

import numpy as np

from roletrust_env.trust.key_index import Floats

_ZONE = re.compile(r"(?:Z|[+-]\d\d(?::?\d\d)?)$")
_DAY = 10  # letters of a date without a time


def check_scale(scale: tuple[float, float]) -> None:
    """Refuse a scale whose best rating is not above its worst.

    Raises:
        ValueError: The scale is no pair of numbers, is empty or not finite.
    """
    if not (
        isinstance(scale, tuple | list | np.ndarray) and len(scale) == 2 and all(isinstance(end, Real) for end in scale)
    ):
        raise ValueError(f"the scale is {scale!r}; it must be the worst and the best rating, two numbers")
    if not -np.inf < scale[0] < scale[1] < np.inf:
        raise ValueError(f"the scale is from {scale[0]:g} to {scale[1]:g}; the best rating must be above the worst")


def unit_ratings(
    ratings: Floats, scale: tuple[float, float], name: Callable[[int], str] = lambda at: f"rating {at + 1} is"
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
        raise ValueError(f"{name(at)} {ratings[at]:g}, off the scale from {worst:g} to {best:g}")
    return (ratings - worst) / (best - worst)


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


def text_seconds(texts: list[str], row: str, first: int, *, zoned: bool) -> Floats:
    """Return dates and times of ISO 8601 as seconds since 1970.

    Args:
        texts: Dates, all with a time zone or all without.
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
            f"{row} {first + wrong}: the time is {texts[wrong]!r}; it must be a date of ISO 8601, as in the rows above"
        )
    other = next((at for at, text in enumerate(texts) if has_zone(text) != zoned), None)
    if other is not None:
        has, have = ("no time zone", "one") if zoned else ("a time zone", "none")
        raise ValueError(f"{row} {first + other}: the time {texts[other]!r} has {has}, and the rows above have {have}")
    return date_seconds(dates)


def _dates(texts: str | list[str]) -> Any:
    """Return dates of NumPy in UTC, in microseconds; NumPy warns that it does not keep time zones."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return np.array(texts, "datetime64[us]")
