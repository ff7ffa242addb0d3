"""The clock of the nodes, which never goes back."""

import time

_last = 0, 0  # monotonic time of the last reading, and the reading, nanoseconds


def now() -> int:
    """Return the time in nanoseconds since 1970, never less than before in this process.

    It follows the clock of the machine, also forwards, see `steady`. When that clock is set back,
    rounds neither stop nor seem to be of the past.
    """
    global _last
    monotonic, (before, reading) = time.monotonic_ns(), _last
    reading = steady(
        time.time_ns(), reading, max(0, monotonic - before)
    )  # another thread may have read since
    _last = monotonic, reading
    return reading


def steady(clock: int, reading: int, elapsed: int) -> int:
    """Return the next reading of a clock that may be set back.

    A reading that is ahead of the clock goes on at half the speed until the clock has caught up, so
    that an error of an hour that was set right is gone after two hours.

    Args:
        clock: Time by the clock.
        reading: Last reading.
        elapsed: Time since then by a clock that nobody sets, in the same unit.
    """
    return max(clock, reading + elapsed // 2)
