"""The rounds of ratings: by time, or by number."""

import math
from collections.abc import Iterator
from numbers import Real
from typing import Any

import numpy as np

from roletrust_env.trust.key_index import Floats, Ints

MOST = 1_000_000
"""Maximum number of rounds of a log; more is taken for a wrong unit of time."""

_NEAR = 4  # times that differ by so many units in the last place are the same


def round_numbers(times: Floats, every: float, start: float) -> Ints:
    """Return the number of the round of each time, shape (n,): round 0 begins at `start`.

    A time that is as near to the beginning of a round as numbers of its size are to each other is at the beginning, so
    that decimal times and lengths, which binary numbers only come near to, have the rounds that they seem to have.

    Example:
        >>> round_numbers(np.array([0.2, 0.3, 0.39]), 0.1, 0.0)
        array([2, 3, 3])

    Args:
        times: Times, shape (n,), none before `start`.
        every: Length of a round, in the unit of the times, above 0.
        start: Time at which round 0 begins.

    Raises:
        ValueError: The length is not above 0, or there would be more than `MOST` rounds.
    """
    if not 0 < every < math.inf:
        raise ValueError(f"the length of a round is {every:g}; it must be above 0")
    last = float(times.max()) if len(times) else start  # Python's numbers overflow without a warning
    if (last - start) / every >= MOST:
        raise ValueError(
            f"rounds of {every:g} from time {start:g} to {last:g} are {(last - start) / every:,.0f}; at most {MOST:,} "
            "are allowed, so the unit of the times may be another"
        )
    quotient = (times - start) / every
    nearest = np.rint(quotient)
    at = np.abs(start + nearest * every - times) <= _NEAR * np.spacing(np.maximum(np.abs(times), abs(start)))
    return np.where(at, nearest, np.floor(quotient)).astype(np.int64)


def spans(numbers: Ints) -> Iterator[tuple[int, slice]]:
    """Yield each round that has ratings, its number and its slice of the ratings, for ascending round numbers."""
    starts = np.flatnonzero(np.diff(numbers, prepend=-1))
    for start, stop in zip(starts, [*starts, len(numbers)][1:], strict=True):
        yield int(numbers[start]), slice(int(start), int(stop))


def check_rounds(every: Any, count: int | None, *, has_times: bool = True) -> None:
    """Refuse lengths of rounds that do not fit, before there are ratings.

    Args:
        every: Length of a round by time; None if rounds do not go by time.
        count: Number of ratings of a round; None if rounds do not go by number.
        has_times: Whether the ratings have times.

    Raises:
        ValueError: Both lengths are given, a length is no number above 0, or there are no times.
    """
    if every is not None and count is not None:
        raise ValueError("rounds go by time or by number of ratings, not by both")
    if every is not None and not has_times:
        raise ValueError("rounds go by time, and the log has no times; name the column of the time")
    if every is not None:
        if not isinstance(every, Real) or isinstance(every, bool | np.bool_ | np.timedelta64):
            raise ValueError(f"the length of a round is {every!r}; it must be a number, for dates one of seconds")
        round_numbers(np.zeros(0), float(every), 0.0)
    if count is not None and not 1 <= count < 2**63:
        raise ValueError(f"the number of ratings of a round is {count}; it must be at least 1 and below 2 ** 63")
