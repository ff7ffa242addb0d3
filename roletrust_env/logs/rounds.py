"""The rounds of ratings by time."""

from collections.abc import Iterator
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt

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


def judged(
    times: Ints, every: int, lead: int | None, start: int | None, latest: int | None, ended: int
) -> tuple[int, npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Return when round 0 of a stream begins, and which of further ratings are late, and which
    ahead.

    Round 0 begins at the earliest time until it has ended. The first ratings have none before them,
    so their median stands for these; those in its past by more than the lead are late.

    Example:
        >>> judged(np.array([31, 12, 900, 40]), 10, 30, 0, 25, 2)
        (0, array([False,  True, False, False]), array([False, False,  True, False]))

    Args:
        times: Times in nanoseconds, shape (n,), n at least 1.
        every: Length of a round in nanoseconds.
        lead: Longest time from one rating to the next; None if there is no limit.
        start: Time at which round 0 begins; None if there are no ratings yet.
        latest: Time of the latest rating so far; None if there are no ratings yet.
        ended: Number of rounds that have ended.

    Raises:
        ValueError: A rating that is not ahead is further away than `MOST` rounds.
    """
    first, last = -(2**63), 2**63 - 1
    if lead is not None:
        known = np.sort(times)[len(times) // 2] if latest is None else latest
        ordered = np.sort(np.append(times, known))
        gaps = np.flatnonzero(np.diff(ordered.astype(np.float64)) > lead)
        below, above = np.split(gaps, [np.searchsorted(gaps, np.searchsorted(ordered, known))])
        first = int(ordered[below[-1] + 1]) if len(below) else first
        last = int(ordered[above[0]]) if len(above) else last
    if not ended:
        earliest = [int(times[times >= first].min())] if (times >= first).any() else []
        start = min([*earliest, *([] if start is None else [start])], default=0)
    begin = 0 if start is None else start
    numbers = round_numbers(np.clip(times, begin, max(begin, last)), every, begin, ended)
    return begin, (numbers < ended) | (times < begin), times > last


def spans(numbers: Ints) -> Iterator[tuple[int, slice]]:
    """Yield each round that has ratings, its number and its slice of the ratings, for ascending
    round numbers.
    """
    starts = [0] * (len(numbers) > 0) + (1 + np.flatnonzero(numbers[1:] != numbers[:-1])).tolist()
    for start, stop in zip(starts, [*starts, len(numbers)][1:], strict=True):
        yield int(numbers[start]), slice(start, stop)


def nanoseconds(name: str, seconds: Any, least: int = 1) -> int:
    """Return a length of time in nanoseconds.

    Args:
        name: Name of the length, for error messages.
        seconds: Length in seconds.
        least: Least number of nanoseconds.

    Raises:
        ValueError: It is not a number of seconds, is too short, or is longer than 292 years.
    """
    known = isinstance(seconds, Real) and not isinstance(seconds, bool | np.bool_ | np.timedelta64)
    if not known or not least <= float(seconds) * SECOND < 2**63:
        raise ValueError(
            f"{name} must be a number of seconds from {least / SECOND:g} to 9.2e9, got {seconds!r}"
        )
    return round(float(seconds) * SECOND)
