"""The rounds of ratings: by time, or by number."""

import math
from collections.abc import Iterator
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.parameters import whole_number
from roletrust_env.trust.key_index import Floats, Ints

MOST = 1_000_000
"""Maximum number of rounds of a log, or from the running one of a stream on; more is taken for a
wrong unit of time."""

_BLOCK = 1 << 16  # times that fit into a processor's cache
_NEAR = 4  # times that differ by so many units in the last place are the same


def round_numbers(times: Floats, every: float, start: float, ended: int = 0) -> Ints:
    """Return the number of the round of each time, shape (n,): round 0 begins at `start`.

    A time that is as near to the beginning of a round as numbers of its size are to each other is
    at the beginning, so that decimal times and lengths, which binary numbers only come near to,
    have the rounds that they seem to have.

    Example:
        >>> round_numbers(np.array([0.2, 0.3, 0.39]), 0.1, 0.0)
        array([2, 3, 3])

    Args:
        times: Times, shape (n,), none before `start`.
        every: Length of a round, in the unit of the times, above 0.
        start: Time at which round 0 begins.
        ended: Number of rounds of a stream that have ended.

    Raises:
        ValueError: The length is not above 0, or there would be more than `MOST` further rounds.
    """
    if not 0 < every < math.inf:
        raise ValueError(f"the length of a round is {every:g}; it must be above 0 and finite")
    last = (
        float(times.max()) if len(times) else start
    )  # Python's numbers overflow without a warning
    if (last - start) / every - ended >= MOST:
        raise ValueError(
            f"rounds of {every:g} from time {start:g} to {last:g} are "
            f"{(last - start) / every:,.0f}; at most {MOST:,} "
            "are allowed, so the unit of the times may be another"
        )
    numbers = np.empty(len(times), np.int64)
    for at in range(0, len(times), _BLOCK):
        some = times[at : at + _BLOCK]
        quotient = (some - start) / every
        nearest = np.rint(quotient)
        near = np.abs(start + nearest * every - some) <= _NEAR * np.spacing(
            np.maximum(np.abs(some), abs(start))
        )
        numbers[at : at + _BLOCK] = np.where(near, nearest, np.floor(quotient))
    return numbers


def judged(
    times: Floats,
    every: float,
    lead: float | None,
    start: float | None,
    latest: float | None,
    ended: int,
) -> tuple[float, npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Return when round 0 of a stream begins, and which of further ratings are late, and which
    ahead.

    Round 0 begins at the earliest time until it has ended. The first ratings have none before them,
    so their median stands for these; those in its past by more than the lead are late.

    Example:
        >>> judged(np.array([31.0, 12.0, 900.0, 40.0]), 10.0, 30.0, 0.0, 25.0, 2)
        (0.0, array([False,  True, False, False]), array([False, False,  True, False]))

    Args:
        times: Times, shape (n,), n at least 1.
        every: Length of a round, in the unit of the times.
        lead: Longest time from one rating to the next; None if there is no limit.
        start: Time at which round 0 begins; None if there are no ratings yet.
        latest: Time of the latest rating so far; None if there are no ratings yet.
        ended: Number of rounds that have ended.

    Raises:
        ValueError: A rating that is not ahead is further away than `MOST` rounds.
    """
    first, last = -math.inf, math.inf
    if lead is not None:
        known = np.sort(times)[len(times) // 2] if latest is None else latest
        ordered = np.sort(np.append(times, known))
        with np.errstate(over="ignore"):
            gaps = np.flatnonzero(np.diff(ordered) > lead)
        below, above = np.split(gaps, [np.searchsorted(gaps, np.searchsorted(ordered, known))])
        first = ordered[below[-1] + 1] if len(below) else first
        last = ordered[above[0]] if len(above) else last
    if not ended:
        start = float(times[times >= first].min(initial=math.inf if start is None else start))
    begin = 0.0 if start is None else start
    numbers = round_numbers(np.clip(times, begin, last), every, begin, ended)
    return begin, (numbers < ended) | (times < begin), times > last


def spans(numbers: Ints) -> Iterator[tuple[int, slice]]:
    """Yield each round that has ratings, its number and its slice of the ratings, for ascending
    round numbers.
    """
    starts = [0] * (len(numbers) > 0) + (1 + np.flatnonzero(numbers[1:] != numbers[:-1])).tolist()
    for start, stop in zip(starts, [*starts, len(numbers)][1:], strict=True):
        yield int(numbers[start]), slice(start, stop)


def check_rounds(every: Any, count: int | None) -> None:
    """Refuse lengths of rounds that do not fit, before there are ratings.

    Args:
        every: Length of a round by time; None if rounds do not go by time.
        count: Number of ratings of a round; None if rounds do not go by number.

    Raises:
        ValueError: Both lengths are given, or a length is no number above 0.
    """
    if every is not None and count is not None:
        raise ValueError("rounds go by time or by number of ratings, not by both")
    if every is not None:
        if not isinstance(every, Real) or isinstance(every, bool | np.bool_ | np.timedelta64):
            raise ValueError(
                f"the length of a round is {every!r}; it must be a number, for dates one of seconds"
            )
        round_numbers(np.zeros(0), float(every), 0.0)
    if count is not None and whole_number("the number of ratings of a round", count, 1) >= 2**63:
        raise ValueError(f"the number of ratings of a round is {count}; it must be below 2 ** 63")


def check_lateness(late: str, lead: Any, every: float | None) -> None:
    """Refuse policies on late and future ratings that are none.

    Args:
        late: What becomes of late ratings.
        lead: Longest time by which a rating may be ahead; None if there is no limit.
        every: Length of a round by time; None if rounds do not go by time.

    Raises:
        ValueError: There is no such policy, the lead is no number of at least 0, or it is given
            without times.
    """
    if late not in ("drop", "count"):
        raise ValueError(f"late is {late!r}; it must be 'drop' or 'count'")
    if lead is None:
        return
    if (
        not isinstance(lead, Real)
        or isinstance(lead, bool | np.bool_)
        or not 0 <= float(lead) < math.inf
    ):
        raise ValueError(
            f"the lead is {lead!r}; it must be a number of at least 0, for dates one of seconds"
        )
    if every is None:
        raise ValueError("a lead needs rounds by time, which have a length")
