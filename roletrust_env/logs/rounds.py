"""The rounds of ratings by time."""

from collections.abc import Iterator
from numbers import Real
from typing import Any

import numpy as np

from roletrust_env.trust.key_index import Ints

SECOND = 10**9
"""Number of nanoseconds in a second."""

MOST = 1_000_000
"""Maximum number of rounds of a log, or from the running one of a stream on; more is taken for a
wrong unit of time."""


def round_numbers(times: Ints, every: int, start: int, ended: int = 0) -> Ints:
    """Return the number of the round of each time, shape (n,): round 0 begins at `start`.

    Args:
        times: Times in nanoseconds, shape (n,), none before `start`.
        every: Length of a round in nanoseconds, above 0.
        start: Time at which round 0 begins.
        ended: Number of rounds of a stream that have ended.

    Raises:
        ValueError: There would be more than `MOST` further rounds.

    Example:
        >>> round_numbers(np.array([20, 30, 39]), 10, 0)
        array([2, 3, 3])
    """
    last = int(times.max()) if len(times) else start
    if (number := (last - start) // every) - ended >= MOST:
        raise ValueError(
            f"there would be {number:,} rounds of {every / SECOND:g} s; at most {MOST:,} are "
            "allowed, so the unit of the times may be another"
        )
    numbers: Ints = (times - start) // every
    return numbers


def spans(numbers: Ints) -> Iterator[tuple[int, slice]]:
    """Yield each round that has ratings, its number and its slice of the ratings, for ascending
    round numbers.
    """
    starts = [0] * (len(numbers) > 0) + (1 + np.flatnonzero(numbers[1:] != numbers[:-1])).tolist()
    for start, stop in zip(starts, [*starts, len(numbers)][1:], strict=True):
        yield int(numbers[start]), slice(start, stop)


def nanoseconds(name: str, seconds: Any) -> int:
    """Return a length of time in nanoseconds.

    Args:
        name: Name of the length, for error messages.
        seconds: Length in seconds.

    Raises:
        ValueError: It is not a number of seconds from a nanosecond to 292 years.
    """
    known = isinstance(seconds, Real) and not isinstance(seconds, bool | np.bool_ | np.timedelta64)
    if not known or not 1 <= float(seconds) * SECOND < 2**63:
        raise ValueError(f"{name} must be a number of seconds from 1e-9 to 9.2e9, got {seconds!r}")
    return round(float(seconds) * SECOND)
