"""Rendered scene: a person walks around a sunny square, in view of the cameras of the providers."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.world.vision.background import background
from roletrust_env.world.vision.camera import FRAME_HEIGHT, FRAME_WIDTH, Camera, FloatArray, Frame, camera_of
from roletrust_env.world.vision.degrade import motion_kernel
from roletrust_env.world.vision.figure import Appearance, paint, pose, shadow

__all__ = ["RenderedScene"]

_LOOKS = (
    Appearance((38, 62, 118), (48, 46, 52), (28, 26, 26), (222, 176, 146), (58, 40, 30)),
    Appearance((132, 36, 42), (40, 52, 78), (30, 28, 28), (196, 146, 112), (28, 22, 20)),
    Appearance((28, 92, 84), (58, 54, 50), (24, 24, 26), (232, 190, 162), (92, 62, 36)),
)
_LAP_S = 7.3  # duration of one lap of the walk, seconds
_HALF_AXES = (1.35, 0.75)  # half axes of the elliptical walk, metres
_SHADE = 0.35  # share of the light that is missing in the shadow
_SOFTNESS = 0.6  # lens blur on the person in pixels, as on the background


class RenderedScene:
    """Rendering of the target of Su and Saint-Jore (2023): a person in clear view of every camera.

    Every frame is a pure function of camera, time, strength and seed. The seed determines the clothes, the clouds, and
    the start of the walk.

    Args:
        seed: Random seed, 0 or more.
    """

    def __init__(self, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        self._look = _LOOKS[int(rng.integers(len(_LOOKS)))]
        self._start_s = float(rng.uniform(0, 60))
        self._sky_offset = rng.uniform(0, 256, 2)
        self._empty: dict[int, Frame] = {}

    def frame(self, camera: int, time_s: float, strength: float = 0.0) -> Frame:
        """Return the frame of a camera.

        Args:
            camera: Index of the camera, from 0 on: ground, ground, aerial in turn.
            time_s: Time in seconds.
            strength: Strength of the perturbation in [0, 1]: 0 is a calm walk, 1 a sprint, with longer strides and with
                motion blur along the direction of movement.

        Returns:
            Frame of shape (FRAME_HEIGHT, FRAME_WIDTH, 3).
        """
        view = camera_of(camera)
        place, heading = _walk(time_s + self._start_s)
        limbs = pose(time_s + self._start_s, strength, place, heading, self._look)
        lit = 255 - np.rint(_SHADE * shadow(limbs, view)).astype(np.uint8)
        picture = np.asarray(cv2.multiply(self.empty(camera), cv2.merge([lit] * 3), scale=1 / 255), np.uint8)
        layer, corner = paint(limbs, view)
        layer = np.asarray(cv2.GaussianBlur(layer, (0, 0), _SOFTNESS), np.float32)
        if strength > 0:
            kernel = motion_kernel(strength, _direction(view, place, heading))
            layer, corner = _smear(layer, corner, kernel)
        _lay_over(picture, layer, corner)
        return picture

    def empty(self, camera: int) -> Frame:
        """Return the frame of a camera without the person, a read-only array."""
        if camera not in self._empty:
            self._empty[camera] = background(camera_of(camera), self._sky_offset)
            self._empty[camera].flags.writeable = False
        return self._empty[camera]


def _walk(time_s: float) -> tuple[FloatArray, float]:
    """Return the position on the ground in metres, shape (2,), and the heading in radians at a time."""
    angle = 2 * math.pi * time_s / _LAP_S
    place = np.array([_HALF_AXES[0] * math.cos(angle), _HALF_AXES[1] * math.sin(angle)])
    return place, math.atan2(_HALF_AXES[1] * math.cos(angle), -_HALF_AXES[0] * math.sin(angle))


def _direction(camera: Camera, place: FloatArray, heading: float) -> tuple[float, float]:
    """Return the direction of movement in the frame, a unit vector (column, row)."""
    chest = np.array([place[0], place[1], 1.0])
    step = 0.05 * np.array([math.cos(heading), math.sin(heading), 0.0])
    pixels, _ = camera.project(np.stack([chest - step, chest + step]))
    column, row = pixels[1] - pixels[0]
    length = math.hypot(column, row)
    return (column / length, row / length) if length > 0 else (1.0, 0.0)


def _smear(
    layer: NDArray[np.float32], corner: tuple[int, int], kernel: NDArray[np.float32]
) -> tuple[NDArray[np.float32], tuple[int, int]]:
    """Blur the layer of the person by a movement. The layer grows by half the size of the kernel on every side."""
    reach = kernel.shape[0] // 2
    wide = np.pad(layer, ((reach, reach), (reach, reach), (0, 0)))
    blurred = cv2.filter2D(wide, -1, kernel, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(blurred, np.float32), (corner[0] - reach, corner[1] - reach)


def _lay_over(picture: Frame, layer: NDArray[np.float32], corner: tuple[int, int]) -> None:
    """Lay the person over the picture, in place, clipped at the border of the picture."""
    left, top = corner
    rows = slice(max(top, 0), min(top + layer.shape[0], FRAME_HEIGHT))
    columns = slice(max(left, 0), min(left + layer.shape[1], FRAME_WIDTH))
    part = layer[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
    picture[rows, columns] = np.rint(picture[rows, columns] * (1 - part[..., 3:]) + part[..., :3])
