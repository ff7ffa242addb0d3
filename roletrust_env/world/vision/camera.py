"""Cameras of the providers: two on ground robots, one on a drone, and so on in turn."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Frame = NDArray[np.uint8]
"""Frame of shape (height, width, 3), RGB, 0 to 255."""
FloatArray = NDArray[np.float64]

FRAME_HEIGHT = 360
"""Height of every frame in pixels; frames of videos, images and cameras are resized to it."""
FRAME_WIDTH = 480
"""Width of a rendered frame in pixels."""

_TARGET = np.array([0.0, 0.0, 0.80])  # point that all cameras look at, metres
_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))  # gives every camera another viewpoint
# Azimuth in radians, distance and height in metres, focal length in pixels: ground, ground, aerial.
_MOUNTS = ((-1.95, 8.2, 1.05, 810.0), (-1.15, 7.6, 1.35, 810.0), (-0.85, 8.4, 3.80, 880.0))


class Camera(NamedTuple):
    """Pinhole camera.

    Attributes:
        position: Position in metres, shape (3,); x and y on the ground, z up.
        axes: Right, down and forward direction, one per row, shape (3, 3).
        focal: Focal length in pixels.
    """

    position: FloatArray
    axes: FloatArray
    focal: float

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Project points in metres, shape (n, 3), to (column, row) pixels, shape (n, 2), and
        depths, shape (n,).
        """
        local = (points - self.position) @ self.axes.T
        pixels = self.focal * local[:, :2] / local[:, 2:] + (FRAME_WIDTH / 2, FRAME_HEIGHT / 2)
        return pixels, local[:, 2]

    def rays(self) -> FloatArray:
        """Return the viewing direction of every pixel, unit vectors of shape (FRAME_HEIGHT,
        FRAME_WIDTH, 3).
        """
        columns = (np.arange(FRAME_WIDTH) - FRAME_WIDTH / 2) / self.focal
        rows = (np.arange(FRAME_HEIGHT) - FRAME_HEIGHT / 2) / self.focal
        x, y = np.meshgrid(columns, rows)
        rays = np.stack([x, y, np.ones_like(x)], -1) @ self.axes
        return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def camera_of(provider: int) -> Camera:
    """Return the camera of a provider, given by its index: ground, ground, aerial, and again from
    other sides.
    """
    azimuth, distance, height, focal = _MOUNTS[provider % len(_MOUNTS)]
    azimuth += provider // len(_MOUNTS) * _GOLDEN_ANGLE
    position = np.array([distance * math.cos(azimuth), distance * math.sin(azimuth), height])
    forward = _TARGET - position
    forward /= np.linalg.norm(forward)
    right = np.array([forward[1], -forward[0], 0.0]) / math.hypot(forward[0], forward[1])
    return Camera(position, np.stack([right, np.cross(forward, right), forward]), focal)
