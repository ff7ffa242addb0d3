"""Pictures of cameras that neither the scenario nor a key names."""

import cv2
import numpy as np
import pytest

from roletrust_manager.dds.nodes import person_detector
from roletrust_manager.dds.nodes.person_detector import StrangePictures, pixels
from roletrust_manager.dds.rounds import RoundTiming

PERIOD = 500_000_000
SMALL = cv2.imencode(".jpg", np.zeros((48, 64, 3), np.uint8))[1].tobytes()


class Detector:
    """Counts the pictures that it sees."""

    def __init__(self):
        self.seen = 0

    def probability(self, jpeg):
        self.seen += 1
        return 0.25


def play(strangers, names, rounds, began):
    """Return the cameras that had their turn in each round."""
    turns = []
    for r in range(1, rounds + 1):
        for name in names:
            strangers.add(name, r * PERIOD, SMALL)
        turns.append(list(strangers.probabilities(r * PERIOD, began())))
    return turns


@pytest.mark.parametrize("count", [1, 12, 200])
def test_one_picture_of_a_stranger_is_looked_at_in_four_rounds(count):
    detector = Detector()
    turns = play(
        StrangePictures(detector, RoundTiming(PERIOD)),
        [f"z{k}" for k in range(count)],
        40,
        lambda: 1e12,
    )
    assert detector.seen == 10
    assert [len(turn) for turn in turns] == [0, 0, 0, 1] * 10


def test_the_turn_passes_from_camera_to_camera():
    turns = play(
        StrangePictures(Detector(), RoundTiming(PERIOD)), ["z0", "z1", "z2"], 24, lambda: 1e12
    )
    seen = [name for turn in turns for name in turn]
    assert {seen.count(name) for name in ("z0", "z1", "z2")} == {2}


def test_no_stranger_is_looked_at_if_the_known_cameras_took_long():
    detector = Detector()
    play(
        StrangePictures(detector, RoundTiming(PERIOD)),
        ["z0"],
        8,
        lambda: person_detector.time.monotonic() - 0.2,
    )
    assert detector.seen == 0


def test_a_picture_that_takes_long_to_decode_is_ignored():
    detector = Detector()
    strangers = StrangePictures(detector, RoundTiming(PERIOD))
    huge = cv2.imencode(".jpg", np.zeros((3000, 3000, 3), np.uint8))[1].tobytes()
    assert len(huge) < 200_000
    for r in range(1, 9):
        strangers.add("z0", r * PERIOD, huge)
        strangers.add("z1", r * PERIOD, SMALL + bytes(1 << 18))
        strangers.add("z2", r * PERIOD, b"nonsense")
        strangers.probabilities(r * PERIOD, 1e12)
    assert detector.seen == 0


def test_an_old_picture_is_of_no_later_round():
    detector = Detector()
    strangers = StrangePictures(detector, RoundTiming(PERIOD))
    strangers.add("z0", PERIOD, SMALL)
    for r in range(2, 10):
        strangers.probabilities(r * PERIOD, 1e12)
    assert detector.seen == 0


@pytest.mark.parametrize("shape", [(48, 64), (1, 1), (700, 900)])
def test_the_pixels_of_a_jpeg_are_known_before_it_is_decoded(shape):
    assert (
        pixels(cv2.imencode(".jpg", np.zeros((*shape, 3), np.uint8))[1].tobytes())
        == shape[0] * shape[1]
    )
