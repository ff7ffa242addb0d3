"""The run loop of a node: the times of the rounds, and the end by a signal."""

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from roletrust_manager.admission import clock

SECOND = 1_000_000_000
SLOWEST, FASTEST = 0.1, 20.0
"""Limits of the speed relative to a scenario's clock."""

_STOP_S = 5.0


def round_period(period_s: float, speed: float) -> int:
    """Return the time between rounds, nanoseconds.

    Args:
        period_s: Time between rounds by the scenario's clock, seconds.
        speed: Speed relative to the scenario's clock, from 0.1 to 20.

    Raises:
        ValueError: The speed is no number in this range.
    """
    if not isinstance(speed, int | float) or not SLOWEST <= speed <= FASTEST:
        raise ValueError(f"speed must be from {SLOWEST:g} to {FASTEST:g}, got {speed!r}")
    return round(period_s * SECOND / speed)


class Timeline(NamedTuple):
    """Start times of the rounds, by the clock of this machine.

    Attributes:
        start: Start of round 0, nanoseconds since 1970.
        period: Time between rounds, nanoseconds.
    """

    start: int
    period: int

    @classmethod
    def aligned(cls, period: int) -> "Timeline":
        """Return a timeline that starts with the next whole period since 1970, so that all nodes
        agree on it.
        """
        return cls((clock.now() // period + 1) * period, period)

    def begin(self, round: int) -> int:
        """Return the stamp of a round."""
        return self.start + round * self.period

    def round(self, stamp: int) -> int:
        """Return the round whose start is nearest to a stamp; negative before the start."""
        return (stamp - self.start + self.period // 2) // self.period

    def next_round(self, after: int = -1) -> int:
        """Return the round to play after another one, -1 for none, without those that are over by
        half a period.

        A process that stood still, or whose clock was set, so goes on at once and not round by
        round.
        """
        running = self.round(clock.now())
        if after >= 0 and running < after - 1:
            return max(running + 1, 0)
        return max(after + 1, running)


class RunState:
    """State of a node: true until SIGTERM or Ctrl-C."""

    def __init__(self) -> None:
        self._stopped = False

    def __bool__(self) -> bool:
        return not self._stopped

    def stop(self, *_: object) -> None:
        """Ask the node to end."""
        self._stopped = True

    def sleep_until(self, moment: int) -> None:
        """Sleep until a moment, nanoseconds since 1970, or until the node is asked to end.

        A clock that is set back meanwhile does not make it longer.
        """
        end = time.monotonic_ns() + moment - clock.now()
        while self and (remaining := min(moment - clock.now(), end - time.monotonic_ns())) > 0:
            time.sleep(min(remaining / SECOND, 0.1))


def print_line(line: str) -> None:
    """Print a line for the user, at once."""
    print(line, file=sys.stderr, flush=True)


@contextmanager
def run_until_signal() -> Iterator[RunState]:
    """Turn SIGTERM and Ctrl-C into a normal end of the node.

    Yields:
        The state, which turns false with the signal.
    """
    state = RunState()
    before = {
        number: signal.signal(number, state.stop) for number in (signal.SIGTERM, signal.SIGINT)
    }
    try:
        yield state
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def run_with_parent(run: Callable[..., object], /, *args: Any, **kwargs: Any) -> None:
    """Run a function in a process of `multiprocessing` that ends with its parent, even if the
    parent is killed.
    """
    threading.Thread(target=_end_with_parent, daemon=True).start()
    run(*args, **kwargs)


def _end_with_parent() -> None:
    """End this process as SIGTERM does when its parent has ended, or some seconds later if it
    ignores that.
    """
    if (parent := multiprocessing.parent_process()) is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_STOP_S)
        os._exit(1)
