"""The clock of the nodes, which no small correction sets back."""

import logging
import time

_SET_BACK = 60 * 10**9  # nanoseconds by which a clock was wrong, and not only corrected a little

_log = logging.getLogger(__name__)
_last = 0, 0  # monotonic time of the last reading, and the reading, nanoseconds


def now() -> int:
    """Return the time in nanoseconds since 1970.

    It follows the clock of the machine. When that is set back by less than a minute, this one goes
    on at half the speed until both agree, so that it is never before an earlier reading. A larger
    step back is followed at once, with a warning in the log.
    """
    global _last
    monotonic, clock, (before, reading) = time.monotonic_ns(), time.time_ns(), _last
    elapsed = max(0, monotonic - before)  # another thread may have read since
    if (set_back := reading + elapsed - clock) >= _SET_BACK:
        _log.warning("the clock was set back by %.0f s", set_back / 1e9)
        reading = clock
    else:
        reading = max(clock, reading + elapsed // 2)
    _last = monotonic, reading
    return reading
