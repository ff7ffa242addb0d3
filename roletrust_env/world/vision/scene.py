"""Rendered scene: a person walks around a sunny square, in view of the cameras of the providers."""

import functools
import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from roletrust_env.randomness import generator
from roletrust_env.world.vision.camera import (
    FRAME_HEIGHT,
    FRAME_WIDTH,
    Camera,
    FloatArray,
    Frame,
    camera_of,
)
from roletrust_env.world.vision.degrade import motion_kernel

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
    texel = (
        reach / camera.focal / np.maximum(fall, 0.02)
    )  # metres of ground per pixel, to fade fine detail
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
    sky = _mix(
        _mix(_SKY_LOW, _SKY_HIGH, np.clip(elevation / 0.5, 0, 1)),
        _CLOUD,
        np.clip(0.8 * clouds, 0, 0.8),
    )
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
    """Return the sum of white noise smoothed at four sizes, shape (_TILE, _TILE), always the
    same.
    """
    margin = _TILE // 4
    white = np.random.default_rng(2023).standard_normal((_TILE, _TILE)).astype(np.float32)
    wrapped = np.pad(white, margin, mode="wrap")
    octaves = [
        cv2.GaussianBlur(wrapped, (0, 0), sigma)[margin:-margin, margin:-margin]
        for sigma in (2, 5, 12, 30)
    ]
    total = np.sum([octave / octave.std() for octave in octaves], axis=0)
    return np.asarray(total / (2 * total.std()), np.float32)


_SUN = np.array([0.45, -0.35, 0.82]) / math.hypot(
    0.45, -0.35, 0.82
)  # direction towards the sun, z up
_AMBIENT = 0.42  # light in the shade
_SUNLIT = 1.08  # light in the sun; above 1, so that bright clothes are slightly overexposed
_CADENCE_HZ = (
    0.93  # gait cycles per second, chosen so that rounds of 0.5 s show more than two phases
)

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
        """Return the direction of a limb that hangs down and swings forward by an angle in
        radians.
        """
        return math.sin(angle) * self.forward - math.cos(angle) * self.up


def pose(
    time_s: float, strength: float, place: FloatArray, heading: float, look: Appearance
) -> list[Limb]:
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
    limbs = (
        legs
        + _arm(body, 1, phase, look)
        + _arm(body, -1, phase + math.pi, look)
        + _trunk(body, look)
    )
    sole = min(
        joint[2] - radius for a, b, ra, rb, _ in legs for joint, radius in ((a, ra), (b, rb))
    )
    hip = np.array([place[0], place[1], -sole])
    return [limb._replace(start=limb.start + hip, end=limb.end + hip) for limb in limbs]


def _leg(body: _Body, side: int, phase: float, look: Appearance) -> list[Limb]:
    """Return the limbs of one leg, with the hip at the origin. The knee bends while the leg swings
    forward.
    """
    thigh = 0.05 + (0.26 + 0.45 * body.strength) * math.sin(phase)
    bend = 0.10 + (0.48 + 0.80 * body.strength) * max(0.0, math.cos(phase)) ** 2
    hip = 0.095 * side * body.left
    knee = hip + 0.43 * body.hanging(thigh)
    ankle = knee + 0.42 * body.hanging(thigh - bend)
    return [
        Limb(hip, knee, 0.092, 0.066, look.trousers),
        Limb(knee, ankle, 0.064, 0.048, look.trousers),
        Limb(
            ankle - 0.03 * body.up,
            ankle + 0.17 * body.forward - 0.10 * bend * body.up,
            0.052,
            0.040,
            look.shoes,
        ),
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
        The layer, shape (h, w, 4), with the colour times the opacity and the opacity in [0, 1], and
        the (column, row) of its upper left corner in the frame.
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
    nz = -np.sqrt(
        np.clip(1 - off_axis, 0, 1)
    )  # camera axes: x right, y down, z away from the camera
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
    ends = np.rint(points.reshape(-1, 2, 2) * 16).astype(
        int
    )  # cv2.line takes sixteenths of a pixel
    mask = np.zeros((FRAME_HEIGHT, FRAME_WIDTH), np.uint8)
    for limb, (start, end), depth in zip(limbs, ends.tolist(), depths[::2], strict=True):
        width = 0.75 * camera.focal * (limb.start_radius + limb.end_radius) / depth
        cv2.line(mask, start, end, 255, max(1, round(width)), cv2.LINE_AA, 4)
    return np.asarray(cv2.blur(mask, (7, 5)), np.uint8)


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

    Every frame is a pure function of camera, time, strength and seed. The seed determines the
    clothes, the clouds, and the start of the walk.

    Args:
        seed: Random seed, 0 or more.
    """

    def __init__(self, seed: int = 0) -> None:
        rng = generator(seed)
        self._look = _LOOKS[int(rng.integers(len(_LOOKS)))]
        self._start_s = float(rng.uniform(0, 60))
        self._sky_offset = rng.uniform(0, 256, 2)
        self._empty: dict[int, Frame] = {}

    def frame(self, camera: int, time_s: float, strength: float = 0.0) -> Frame:
        """Return the frame of a camera.

        Args:
            camera: Index of the camera, from 0 on: ground, ground, aerial in turn.
            time_s: Time in seconds.
            strength: Strength of the perturbation in [0, 1]: 0 is a calm walk, 1 a sprint, with
                longer strides and with motion blur along the direction of movement.

        Returns:
            Frame of shape (FRAME_HEIGHT, FRAME_WIDTH, 3).
        """
        view = camera_of(camera)
        place, heading = _walk(time_s + self._start_s)
        limbs = pose(time_s + self._start_s, strength, place, heading, self._look)
        lit = 255 - np.rint(_SHADE * shadow(limbs, view)).astype(np.uint8)
        picture = np.asarray(
            cv2.multiply(self.empty(camera), cv2.merge([lit] * 3), scale=1 / 255), np.uint8
        )
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
    """Return the position on the ground in metres, shape (2,), and the heading in radians at a
    time.
    """
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
    """Blur the layer of the person by a movement. The layer grows by half the size of the kernel on
    every side.
    """
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
