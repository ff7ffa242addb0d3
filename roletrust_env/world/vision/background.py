"""Background of the rendered scene: a paved square, a lawn, a hedge on the horizon and the sky, from any camera."""

import functools

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.world.vision.camera import Camera, FloatArray, Frame

__all__ = ["background"]

_TILE = 512  # texels of the noise that all textures are made of; it repeats without a seam
_PAVED_RADIUS = 5.5  # metres
_STONE = np.array([196.0, 188.0, 174.0])
_GRASS = np.array([112.0, 142.0, 78.0])
_HAZE = np.array([198.0, 214.0, 226.0])
_SKY_LOW = np.array([206.0, 224.0, 240.0])
_SKY_HIGH = np.array([110.0, 160.0, 215.0])
_CLOUD = np.array([250.0, 250.0, 250.0])
_HEDGE = np.array([96.0, 122.0, 92.0])


def background(camera: Camera, sky_offset: FloatArray) -> Frame:
    """Return the frame of a camera without the person.

    Args:
        camera: Camera.
        sky_offset: Offset of the clouds in the noise texture, in texels, shape (2,).

    Returns:
        Frame of shape (FRAME_HEIGHT, FRAME_WIDTH, 3).
    """
    rays = camera.rays()
    on_ground = (rays[..., 2] < -1e-3)[..., None]
    picture = np.where(on_ground, _ground(camera, rays), _sky(rays, sky_offset))
    soft = cv2.GaussianBlur(picture, (0, 0), 0.8)
    return np.clip(soft, 0, 255).astype(np.uint8)


def _ground(camera: Camera, rays: FloatArray) -> FloatArray:
    """Return the colour of the ground along every ray; it is meaningless above the horizon."""
    fall = np.maximum(-rays[..., 2], 1e-3)
    reach = camera.position[2] / fall
    x, y = (camera.position[k] + reach * rays[..., k] for k in (0, 1))
    texel = reach / camera.focal / np.maximum(fall, 0.02)  # metres of ground per pixel, to fade fine detail
    fine = _noise(x * 40, y * 40) * np.minimum(0.02 / texel, 1)
    broad = _noise(x * 5 + 100, y * 5)
    slab = _noise(np.rint(x) * 37.5, np.rint(y) * 53.5)
    joint = np.maximum(_joint(x), _joint(y)) * np.minimum(0.03 / texel, 1)
    stone = _STONE + (5 * (fine + broad + slab) - 26 * joint)[..., None]
    grass = _GRASS + (12 * (fine + broad))[..., None] * (1.0, 1.0, 0.6)
    lawn = np.clip((np.hypot(x, y) - _PAVED_RADIUS) / 0.15 + broad, 0, 1)
    return _mix(_mix(stone, grass, lawn), _HAZE, 1 - np.exp(-reach / 60))


def _sky(rays: FloatArray, offset: FloatArray) -> FloatArray:
    """Return the colour of the sky, and of the hedge on the horizon, along every ray."""
    azimuth = np.arctan2(rays[..., 1], rays[..., 0])
    elevation = np.arcsin(rays[..., 2])
    clouds = _noise(azimuth * 120 + offset[0], elevation * 420 + offset[1])
    sky = _mix(_mix(_SKY_LOW, _SKY_HIGH, np.clip(elevation / 0.5, 0, 1)), _CLOUD, np.clip(0.8 * clouds, 0, 0.8))
    hedge = _HEDGE + (16 * _noise(azimuth * 400, elevation * 800))[..., None]
    crown = 0.05 + 0.02 * _noise(azimuth * 200, np.full_like(azimuth, 77.0))
    return _mix(sky, hedge, np.clip((crown - elevation) / 0.008, 0, 1))


def _joint(metres: FloatArray) -> FloatArray:
    """Return 1 in the joints between slabs of 1 m, and 0 on the slabs."""
    return np.asarray(np.exp(-(((metres - np.rint(metres)) / 0.02) ** 2)))


def _mix(below: FloatArray, above: FloatArray, share: FloatArray) -> FloatArray:
    """Mix two colours, with the share of the upper one in [0, 1], shape (height, width)."""
    return below + (above - below) * share[..., None]


def _noise(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return smooth noise, about -1 to 1, at texel coordinates of shape (height, width)."""
    columns, rows = (np.mod(v, _TILE).astype(np.float32) for v in (x, y))
    sampled = cv2.remap(_noise_tile(), columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    return np.asarray(sampled, np.float64)


@functools.cache
def _noise_tile() -> NDArray[np.float32]:
    """Return the sum of white noise smoothed at four sizes, shape (_TILE, _TILE), always the same."""
    margin = _TILE // 4
    white = np.random.default_rng(2023).standard_normal((_TILE, _TILE)).astype(np.float32)
    wrapped = np.pad(white, margin, mode="wrap")
    octaves = [cv2.GaussianBlur(wrapped, (0, 0), sigma)[margin:-margin, margin:-margin] for sigma in (2, 5, 12, 30)]
    total = np.sum([octave / octave.std() for octave in octaves], axis=0)
    return np.asarray(total / (2 * total.std()), np.float32)
