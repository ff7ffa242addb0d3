"""The pace of rounds on this machine: how long the work of a round takes, and whether rounds keep
up.
"""

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np

from roletrust_env.world.vision.detector import best_margin, detector_view
from roletrust_env.world.vision.frames import open_frames
from roletrust_manager.dds.nodes.run_loop import Timeline
from roletrust_manager.journal.lines import JournalEntry

WINDOW = 20
"""Number of the last rounds that show whether rounds keep up."""

_TRIALS = 8
_LATE = 3  # rounds until one is certainly closed


def work_s(raters: int, providers: int) -> float:
    """Return the longest time in seconds, of a few trials, that raters took for the pictures of all
    providers.
    """
    cv2.setNumThreads(1)  # as in the nodes
    frame = open_frames(None, duration_s=1.0, period_s=1.0, loop=False).frame(0, 0.0, 0.0)
    taken_s = []

    def rate(rater: int) -> None:
        for _ in range(providers):
            best_margin(detector_view(np.ascontiguousarray(frame)))

    with ThreadPoolExecutor(raters) as threads:  # OpenCV releases the lock of Python
        for _ in range(_TRIALS):
            began = time.monotonic()
            list(threads.map(rate, range(raters)))
            taken_s.append(time.monotonic() - began)
    return max(taken_s[1:])  # the first has to load the detector


def incomplete(entries: Sequence[JournalEntry], timeline: Timeline, now: int) -> int:
    """Return how many of the last `WINDOW` rounds lack a rater, or were not closed at all; 0 before
    so many rounds.

    Args:
        entries: Rounds in the journal.
        timeline: Start times of the rounds.
        now: Time, nanoseconds.
    """
    last = timeline.round(now) - _LATE
    if last < WINDOW:
        return 0
    complete = {timeline.round(entry.stamp) for entry in entries if not entry.missing}
    return len(set(range(last - WINDOW, last)) - complete)
