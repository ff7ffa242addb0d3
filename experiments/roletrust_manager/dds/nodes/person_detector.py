"""People detection in pictures, first in those of known cameras, and now and then in one of a
stranger.
"""

import time

import cv2
import numpy as np

from roletrust_env.world.vision.degrade import transmit
from roletrust_env.world.vision.detector import best_margin, detector_view, probability
from roletrust_manager.dds.rounds import RoundTiming

_EVERY = 4  # rounds between two pictures of strangers that are decoded
_SHARE = 0.1  # of the period: no stranger has a turn if the pictures of known cameras took longer
_MAX_BYTES = 1 << 18  # of a stranger's JPEG
_MAX_PIXELS = 1 << 21  # of a stranger's picture, which may take much longer to decode than to send


class PersonDetector:
    """Detects people in pictures, each of which arrives with the noise of its link."""

    def __init__(self, links: np.random.Generator) -> None:
        self._links = links

    def probability(self, jpeg: bytes) -> float:
        """Return the probability that a picture shows a person; 0 if it cannot be decoded."""
        try:
            picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
            features = (
                None
                if picture is None
                else detector_view(np.ascontiguousarray(picture[..., ::-1], np.uint8))
            )
        except cv2.error:  # empty, or of a shape that no camera has
            features = None
        if features is None:
            return 0.0
        return probability(best_margin(transmit(features, float(self._links.standard_normal()))))


class StrangePictures:
    """The pictures of cameras without a key and without a place in the scenario.

    They cost the raters next to nothing: one picture is looked at every few rounds, the turn passes
    from camera to camera, and nobody has a turn if the known cameras took too long.

    Args:
        detector: Detector of people.
        timing: Timing of the rounds.
    """

    def __init__(self, detector: PersonDetector, timing: RoundTiming) -> None:
        self._detector, self._timing = detector, timing
        self._pictures: dict[
            str, tuple[int, bytes]
        ] = {}  # the newest of each camera; the next turn comes first
        self._rounds = 0

    def add(self, camera: str, stamp: int, jpeg: bytes) -> None:
        """Keep a picture until the end of its round; one that is too large is ignored."""
        if len(jpeg) <= _MAX_BYTES and pixels(jpeg) <= _MAX_PIXELS:
            self._pictures[camera] = stamp, jpeg

    def probabilities(self, stamp: int, began: float) -> dict[str, float]:
        """Return the probability of a person for the cameras that have their turn in a round: one
        or none.

        Args:
            stamp: Stamp of the round, nanoseconds.
            began: Time at which the work on the round began, seconds by the monotonic clock.
        """
        self._pictures = {
            camera: (taken, jpeg)
            for camera, (taken, jpeg) in self._pictures.items()
            if taken > stamp - self._timing.max_spread
        }
        self._rounds += 1
        spent = time.monotonic() - began
        if self._rounds % _EVERY or spent > _SHARE * self._timing.period / 1e9:
            return {}
        for camera, (taken, jpeg) in self._pictures.items():
            if taken <= stamp + self._timing.max_spread:
                del self._pictures[camera]  # its next picture comes last
                return {camera: self._detector.probability(jpeg)}
        return {}


def pixels(jpeg: bytes) -> int:
    """Return the number of pixels that a JPEG announces, without decoding it; a very large number
    if it is none.

    Example:
        >>> pixels(b"no picture") > 10**12
        True
    """
    at, none = 2, 1 << 62
    while jpeg[:2] == b"\xff\xd8" and at + 9 <= len(jpeg) and jpeg[at] == 0xFF:
        marker, size = jpeg[at + 1], int.from_bytes(jpeg[at + 2 : at + 4], "big")
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):  # start of frame
            return int.from_bytes(jpeg[at + 5 : at + 7], "big") * int.from_bytes(
                jpeg[at + 7 : at + 9], "big"
            )
        at += 2 + size
    return none
