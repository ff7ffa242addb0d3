"""The clock of the nodes, which never goes back."""

import time

_lead = 0  # greatest lead of the machine's clock over monotonic time so far, nanoseconds


def now() -> int:
    """Return the time in nanoseconds since 1970, never less than before in this process.

    It follows the clock of the machine, also forwards. When that clock is set back, it goes on as if it were not, so
    that rounds neither stop nor seem to be of the past.
    """
    global _lead
    monotonic = time.monotonic_ns()
    _lead = max(_lead, time.time_ns() - monotonic)
    return monotonic + _lead
