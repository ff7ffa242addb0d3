"""People detection on one frame with OpenCV, and the probability of a person.

The detector is the histogram of oriented gradients (HOG) with a linear support vector machine (N.
Dalal and B. Triggs, "Histograms of Oriented Gradients for Human Detection", CVPR 2005) with which
Su and Saint-Jore (2023) rate their cameras. Platt scaling turns its margin into a probability (J.
Platt, "Probabilistic Outputs for Support Vector Machines", 1999).
"""

import functools
import math

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.world.vision.camera import Frame

GreyFrame = NDArray[np.uint8]

SLOPE = 3.54
OFFSET = -2.20
"""Constants of Platt scaling, fitted by `fit_calibration` on `labelled_margins` in
`tests/world/vision/calibration.py`.

The same two numbers are used for every camera, frame source, attack and figure.
"""

_HEIGHT = 240  # height of the detector's copy of a frame
_WINDOW = (
    64,
    128,
)  # width and height of the detector's window; a person fills about 96 of its rows
_COARSE_SCALES = (0.93, 0.80, 0.67)  # for people with 40 to 60 % of the height of the frame
_COARSE_STRIDE = (8, 8)
_FINE_SCALES = (0.96, 1.04)  # relative to each coarse scale
_FINE_STRIDE = (4, 4)
_FINE_REACH = 4  # pixels around the coarse window
_ANY_MARGIN = (
    -1e9
)  # threshold below all margins, so that there is a best window even without a person


def detector_view(frame: Frame) -> GreyFrame:
    """Return the detector's copy of a frame (height, width, 3): grey, 240 rows, with the same
    aspect ratio.
    """
    grey = cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)
    width = round(frame.shape[1] * _HEIGHT / frame.shape[0])
    return np.asarray(cv2.resize(grey, (width, _HEIGHT), interpolation=cv2.INTER_AREA), np.uint8)


def best_margin(grey: GreyFrame) -> float:
    """Return the margin of the support vector machine for the window that looks most like a person.

    A coarse pass over a small pyramid finds the best window of each scale. A fine pass around each
    of them makes the margin independent of the position of the person on the coarse grid, which
    changes it by up to one unit.

    Args:
        grey: Frame as `view` returns it, shape (240, width), with a width of at least 96.

    Returns:
        The margin: 1.5 to 7 with a person in clear view, below -0.8 without.
    """
    best = -math.inf
    for coarse in _COARSE_SCALES:
        margin, (column, row) = _search(_scaled(grey, coarse), _COARSE_STRIDE)
        best = max(best, margin)
        centre = ((column + _WINDOW[0] / 2) / coarse, (row + _WINDOW[1] / 2) / coarse)
        for fine in (coarse * zoom for zoom in _FINE_SCALES):
            part = _scaled(_around(grey, centre, fine), fine)
            if part.shape[0] >= _WINDOW[1] and part.shape[1] >= _WINDOW[0]:
                best = max(best, _search(part, _FINE_STRIDE)[0])
    return best


def probability(margin: float) -> float:
    """Return the probability that the target is in the frame, 1 / (1 + exp(-(SLOPE margin +
    OFFSET))).
    """
    return 1 / (1 + math.exp(-(SLOPE * margin + OFFSET)))


@functools.cache
def _people_detector() -> cv2.HOGDescriptor:
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(np.array(cv2.HOGDescriptor.getDefaultPeopleDetector(), np.float32))
    return hog


def _search(grey: GreyFrame, stride: tuple[int, int]) -> tuple[float, tuple[int, int]]:
    """Return the best margin over a grid of windows, and the (column, row) of its window."""
    corners, margins = _people_detector().detect(grey, hitThreshold=_ANY_MARGIN, winStride=stride)
    best = int(np.argmax(margins))
    return float(margins[best]), (int(corners[best][0]), int(corners[best][1]))


def _scaled(grey: GreyFrame, scale: float) -> GreyFrame:
    return np.asarray(
        cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR), np.uint8
    )


def _around(grey: GreyFrame, centre: tuple[float, float], scale: float) -> GreyFrame:
    """Return the part of a frame around a window at some scale, with a margin, clipped at the
    border of the frame.
    """
    x, y = ((side / 2 + _FINE_REACH) / scale for side in _WINDOW)
    rows = slice(max(0, round(centre[1] - y)), round(centre[1] + y))
    columns = slice(max(0, round(centre[0] - x)), round(centre[0] + x))
    return grey[rows, columns]
