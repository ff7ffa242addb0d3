"""Keyboard interrupts, which a shell sends to all processes of a command."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Block keyboard interrupts, also for processes that start here: each would end with a
    traceback.
    """
    if os.name != "posix":
        yield
        return
    resource_tracker.ensure_running()  # which a first start does, and then unblocks them
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
