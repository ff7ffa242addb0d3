"""Rendering of a walking person made of tapered limbs, with a gait and a single light."""

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.world.vision.camera import FRAME_HEIGHT, FRAME_WIDTH, Camera, FloatArray

__all__ = ["Appearance", "Limb", "paint", "pose", "shadow"]

_SUN = np.array([0.45, -0.35, 0.82]) / math.hypot(0.45, -0.35, 0.82)  # direction towards the sun, z up
_AMBIENT = 0.42  # light in the shade
_SUNLIT = 1.08  # light in the sun; above 1, so that bright clothes are slightly overexposed
_CADENCE_HZ = 0.93  # gait cycles per second, chosen so that rounds of 0.5 s show more than two phases

Colour = tuple[float, float, float]


class Appearance(NamedTuple):
    """Colours (RGB, 0 to 255) of a person's clothes, skin and hair."""

    jacket: Colour
    trousers: Colour
    shoes: Colour
    skin: Colour
    hair: Colour


class Limb(NamedTuple):
    """Rounded, tapered limb between two joints.

    Attributes:
        start: First joint in metres, shape (3,).
        end: Second joint in metres, shape (3,).
        start_radius: Radius at the first joint, metres.
        end_radius: Radius at the second joint, metres.
        colour: Colour, RGB, 0 to 255.
    """

    start: FloatArray
    end: FloatArray
    start_radius: float
    end_radius: float
    colour: Colour


class _Body(NamedTuple):
    """Directions of a body, unit vectors of shape (3,), and the strength of the perturbation."""

    forward: FloatArray
    left: FloatArray
    up: FloatArray
    spine: FloatArray
    strength: float

    def hanging(self, angle: float) -> FloatArray:
        """Return the direction of a limb that hangs down and swings forward by an angle in radians."""
        return math.sin(angle) * self.forward - math.cos(angle) * self.up


def pose(time_s: float, strength: float, place: FloatArray, heading: float, look: Appearance) -> list[Limb]:
    """Return the limbs of the person at one instant of a walk or run.

    Args:
        time_s: Time in seconds, which sets the phase of the gait.
        strength: Strength of the perturbation in [0, 1]: 0 is a calm walk, 1 a sprint.
        place: Position on the ground in metres, shape (2,).
        heading: Direction of movement, in radians from the x axis.
        look: Colours of the person.

    Returns:
        The limbs, in no particular order, with the lower foot on the ground.
    """
    phase = 2 * math.pi * _CADENCE_HZ * time_s
    lean = 0.04 + 0.22 * strength
    forward = np.array([math.cos(heading), math.sin(heading), 0.0])
    left = np.array([-math.sin(heading), math.cos(heading), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    body = _Body(forward, left, up, math.cos(lean) * up + math.sin(lean) * forward, strength)
    legs = _leg(body, 1, phase, look) + _leg(body, -1, phase + math.pi, look)
    limbs = legs + _arm(body, 1, phase, look) + _arm(body, -1, phase + math.pi, look) + _trunk(body, look)
    sole = min(joint[2] - radius for a, b, ra, rb, _ in legs for joint, radius in ((a, ra), (b, rb)))
    hip = np.array([place[0], place[1], -sole])
    return [limb._replace(start=limb.start + hip, end=limb.end + hip) for limb in limbs]


def _leg(body: _Body, side: int, phase: float, look: Appearance) -> list[Limb]:
    """Return the limbs of one leg, with the hip at the origin. The knee bends while the leg swings forward."""
    thigh = 0.05 + (0.26 + 0.45 * body.strength) * math.sin(phase)
    bend = 0.10 + (0.48 + 0.80 * body.strength) * max(0.0, math.cos(phase)) ** 2
    hip = 0.095 * side * body.left
    knee = hip + 0.43 * body.hanging(thigh)
    ankle = knee + 0.42 * body.hanging(thigh - bend)
    return [
        Limb(hip, knee, 0.092, 0.066, look.trousers),
        Limb(knee, ankle, 0.064, 0.048, look.trousers),
        Limb(ankle - 0.03 * body.up, ankle + 0.17 * body.forward - 0.10 * bend * body.up, 0.052, 0.040, look.shoes),
    ]


def _arm(body: _Body, side: int, phase: float, look: Appearance) -> list[Limb]:
    """Return the limbs of one arm, which swings against the leg on the same side."""
    angle = 0.3 * (0.04 + 0.22 * body.strength) - (0.26 + 0.50 * body.strength) * math.sin(phase)
    bend = 0.25 + 1.10 * body.strength
    shoulder = 0.50 * body.spine + 0.205 * side * body.left
    elbow = shoulder + 0.28 * body.hanging(angle) + 0.035 * side * body.left
    wrist = elbow + 0.23 * body.hanging(angle + bend)
    return [
        Limb(shoulder, elbow, 0.064, 0.052, look.jacket),
        Limb(elbow, wrist, 0.050, 0.040, look.jacket),
        Limb(wrist, wrist + 0.07 * body.hanging(angle + bend + 0.1), 0.038, 0.030, look.skin),
    ]


def _trunk(body: _Body, look: Appearance) -> list[Limb]:
    """Return pelvis, chest, shoulders, neck and head."""
    forward, left, up, spine = body.forward, body.left, body.up, body.spine
    neck = 0.55 * spine
    skull = neck + 0.15 * up + 0.02 * forward
    crown, brow = skull + 0.06 * up, skull + 0.01 * up + 0.088 * forward
    return [
        Limb(0.01 * spine, 0.08 * spine, 0.150, 0.155, look.trousers),
        Limb(0.10 * spine, 0.38 * spine, 0.152, 0.182, look.jacket),
        Limb(0.495 * spine + 0.14 * left, 0.495 * spine - 0.14 * left, 0.085, 0.085, look.jacket),
        Limb(neck - 0.04 * spine, neck + 0.06 * up, 0.055, 0.052, look.skin),
        Limb(skull - 0.035 * up + 0.01 * forward, skull + 0.035 * up, 0.082, 0.094, look.skin),
        Limb(crown - 0.035 * forward, skull - 0.01 * up - 0.045 * forward, 0.094, 0.086, look.hair),
        Limb(crown + 0.020 * forward, crown - 0.030 * forward, 0.076, 0.090, look.hair),
        Limb(brow + 0.034 * left, brow + 0.034 * left, 0.012, 0.012, look.hair),
        Limb(brow - 0.034 * left, brow - 0.034 * left, 0.012, 0.012, look.hair),
    ]


def paint(limbs: list[Limb], camera: Camera) -> tuple[NDArray[np.float32], tuple[int, int]]:
    """Paint limbs from far to near on a transparent layer of the smallest possible size.

    Args:
        limbs: Limbs, in world coordinates.
        camera: Camera.

    Returns:
        The layer, shape (h, w, 4), with the colour times the opacity and the opacity in [0, 1], and the (column, row)
        of its upper left corner in the frame.
    """
    starts, depths_a = camera.project(np.array([limb.start for limb in limbs]))
    ends, depths_b = camera.project(np.array([limb.end for limb in limbs]))
    radii_a = camera.focal * np.array([limb.start_radius for limb in limbs]) / depths_a
    radii_b = camera.focal * np.array([limb.end_radius for limb in limbs]) / depths_b
    reach = np.maximum(radii_a, radii_b)[:, None] + 2.0
    lows = np.floor(np.minimum(starts, ends) - reach).astype(int)
    highs = np.ceil(np.maximum(starts, ends) + reach).astype(int)
    corner = lows.min(0)
    width, height = highs.max(0) - corner
    layer = np.zeros((height, width, 4), np.float32)
    sun = (camera.axes @ _SUN).astype(np.float32)
    for k in np.argsort(-(depths_a + depths_b)):
        low, high = lows[k] - corner, highs[k] - corner
        _paint_limb(
            layer[low[1] : high[1], low[0] : high[0]],
            (starts[k] - lows[k]).astype(np.float32),
            (ends[k] - lows[k]).astype(np.float32),
            float(radii_a[k]),
            float(radii_b[k]),
            np.array(limbs[k].colour, np.float32),
            sun,
        )
    return layer, (int(corner[0]), int(corner[1]))


def _paint_limb(
    patch: NDArray[np.float32],
    start: NDArray[np.float32],
    end: NDArray[np.float32],
    start_radius: float,
    end_radius: float,
    colour: NDArray[np.float32],
    sun: NDArray[np.float32],
) -> None:
    """Paint one limb over a patch of the layer, in place, with the normals of a rounded cone."""
    rows, columns = patch.shape[:2]
    x = np.arange(columns, dtype=np.float32)[None, :] - start[0]
    y = np.arange(rows, dtype=np.float32)[:, None] - start[1]
    dx, dy = end - start
    along = np.clip((x * dx + y * dy) / max(float(dx * dx + dy * dy), 1e-6), 0, 1)
    radius = start_radius + (end_radius - start_radius) * along
    nx, ny = (x - along * dx) / radius, (y - along * dy) / radius
    off_axis = nx * nx + ny * ny
    nz = -np.sqrt(np.clip(1 - off_axis, 0, 1))  # camera axes: x right, y down, z away from the camera
    cover = np.clip((1 - np.sqrt(off_axis)) * radius + 0.5, 0, 1)[..., None]
    light = _AMBIENT + (_SUNLIT - _AMBIENT) * np.clip(nx * sun[0] + ny * sun[1] + nz * sun[2], 0, 1)
    patch[..., :3] += cover * (np.minimum(colour * light[..., None], 255) - patch[..., :3])
    patch[..., 3:] += cover * (1 - patch[..., 3:])


def shadow(limbs: list[Limb], camera: Camera) -> NDArray[np.uint8]:
    """Return the shadow of the limbs on the ground.

    Args:
        limbs: Limbs, in world coordinates.
        camera: Camera.

    Returns:
        Darkness of the shadow, shape (FRAME_HEIGHT, FRAME_WIDTH), from 0 for no shadow to 255.
    """
    joints = np.array([[limb.start, limb.end] for limb in limbs])
    flat = joints - joints[..., 2:] / _SUN[2] * _SUN
    points, depths = camera.project(flat.reshape(-1, 3))
    ends = np.rint(points.reshape(-1, 2, 2) * 16).astype(int)  # cv2.line takes sixteenths of a pixel
    mask = np.zeros((FRAME_HEIGHT, FRAME_WIDTH), np.uint8)
    for limb, (start, end), depth in zip(limbs, ends.tolist(), depths[::2], strict=True):
        width = 0.75 * camera.focal * (limb.start_radius + limb.end_radius) / depth
        cv2.line(mask, start, end, 255, max(1, round(width)), cv2.LINE_AA, 4)
    return np.asarray(cv2.blur(mask, (7, 5)), np.uint8)
