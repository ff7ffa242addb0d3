"""Degradation of a frame before detection: fast movement of the target, low quality of the
provider, a noisy link.
"""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.world.vision.camera import Frame

# At quality 0:
_DEFOCUS = 8.7  # pixels of Gaussian blur
_NOISE = 22.5  # grey levels of sensor noise
_DARKNESS = 0.62  # share of the light that is lost
_COVER = np.array([26.0, 22.0, 20.0], np.float32)  # colour of the cover on the lens, RGB
_COVER_EDGE = 0.12  # width of its soft edge, share of the height

_MOTION = 32.0  # pixels that the target moves during an exposure at strength 1

_LINK_GAIN = 0.05  # standard deviation of the logarithm of a rater's exposure
_LINK_NOISE = 1.2  # grey levels


def motion_kernel(strength: float, direction: tuple[float, float]) -> NDArray[np.float32]:
    """Return the blur kernel of a fast movement during the exposure.

    Args:
        strength: Strength of the perturbation in [0, 1]; the movement is 32 pixels long at 1.
        direction: Direction of the movement, a unit vector (column, row).

    Returns:
        Square kernel with a sum of 1.
    """
    half = _MOTION * strength / 2
    reach = math.ceil(half) + 1
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1), np.uint8)
    # cv2.line takes fixed-point coordinates, here with 4 fractional bits: sixteenths of a pixel.
    ends = [[round(16 * (reach + sign * half * d)) for d in direction] for sign in (-1, 1)]
    cv2.line(kernel, ends[0], ends[1], 255, 1, cv2.LINE_AA, 4)
    return kernel.astype(np.float32) / np.float32(kernel.sum())


def degrade(frame: Frame, quality: float, seed: tuple[int, ...]) -> Frame:
    """Return the frame of a provider at the quality that it chose.

    With loss = 1 - quality: defocus of 8.7 sqrt(loss) pixels, sensor noise of 22.5 sqrt(loss) grey
    levels, 62 loss % of the light lost, and the lens covered from below over a share loss^3 of the
    frame. At high quality, defocus and noise have most effect; at low quality, the cover does. At
    quality 0 nothing of the scene is visible. The frame carries no rating: the perceived quality is
    the result of the detector on this frame.

    Args:
        frame: True frame, shape (height, width, 3).
        quality: Quality in [0, 1].
        seed: Random seed of the sensor noise.

    Returns:
        The frame at that quality; at quality 1 it is the same object.
    """
    if quality == 1:
        return frame
    loss = 1 - quality
    fault = math.sqrt(loss)
    height, width = frame.shape[:2]
    picture = cv2.GaussianBlur(frame, (0, 0), _DEFOCUS * fault).astype(np.float32)
    above_bottom = 1 - (np.arange(height, dtype=np.float32)[:, None, None] + 0.5) / height
    uncovered = np.clip(1 + (above_bottom - (1 + _COVER_EDGE) * loss**3) / _COVER_EDGE, 0, 1)
    picture = (_COVER + (picture - _COVER) * uncovered) * (1 - _DARKNESS * loss)
    grain = np.random.default_rng(seed).standard_normal((height, width, 1), dtype=np.float32)
    return np.asarray(np.clip(np.rint(picture + _NOISE * fault * grain), 0, 255), np.uint8)


def transmit(grey: NDArray[np.uint8], noise: float) -> NDArray[np.uint8]:
    """Return the copy of a frame that a rater receives, with a slightly different exposure and
    noise on the link.

    Args:
        grey: Frame of the provider as `detector.view` returns it, shape (height, width).
        noise: Standard normal number. It sets the exposure, and its bits are the seed of the link
            noise, so the same number always gives the same copy.

    Returns:
        The copy, shape (height, width).
    """
    rng = np.random.default_rng(int(np.float64(noise).view(np.uint64)))
    copy = _LINK_NOISE * rng.standard_normal(grey.shape, dtype=np.float32)
    copy += np.float32(math.exp(_LINK_GAIN * noise)) * grey
    return np.asarray(np.clip(np.rint(copy), 0, 255), np.uint8)
