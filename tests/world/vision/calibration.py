"""Calibration of the people detector: `fit_calibration(*labelled_margins())` gives its constants
SLOPE and OFFSET."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from roletrust_env.world.vision.camera import Frame
from roletrust_env.world.vision.degrade import degrade, transmit
from roletrust_env.world.vision.detector import best_margin, detector_view
from roletrust_env.world.vision.scene import RenderedScene

_SPAN_S = 120.0  # the times are drawn from the first two minutes


def labelled_margins(
    seeds: Iterable[int] = range(3), cameras: Iterable[int] = range(6), moments: int = 8
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the margins of labelled frames as raters receive them: with the person, without, and
    with a covered lens.

    Args:
        seeds: Seeds of the scenes.
        cameras: Indices of the cameras, on the ground and in the air.
        moments: Number of random times per scene and camera. Each of them gives one frame of each
            kind.

    Returns:
        The margins, shape (n,), and whether the person is in clear view, shape (n,).
    """
    cameras = tuple(cameras)
    margins, labels = [], []
    for seed in seeds:
        scene = RenderedScene(seed)
        rng = np.random.default_rng(seed)
        for camera in cameras:
            for k in range(moments):
                clear = scene.frame(camera, float(rng.uniform(0, _SPAN_S)))
                frames: tuple[Frame, ...] = (
                    clear,
                    scene.empty(camera),
                    degrade(clear, 0.0, (seed, camera, k)),
                )
                margins += [
                    best_margin(transmit(detector_view(frame), rng.standard_normal()))
                    for frame in frames
                ]
                labels += [True, False, False]
    return np.array(margins), np.array(labels)


def fit_calibration(
    margins: NDArray[np.float64], labels: NDArray[np.bool_], *, doubt: float = 1e-4
) -> tuple[float, float]:
    """Fit the slope and the offset of Platt scaling by maximum likelihood, with Newton's method.

    Platt (1999) replaces the labels 1 and 0 by the targets (n + 1) / (n + 2) and 1 / (n + 2).
    Without that, the slope grows without bound if the margins of the two kinds of frame do not
    overlap, as here. The rendered frames are far from independent, and their number should not
    change the probabilities. So the targets are 1 - doubt and doubt instead. The default is Platt's
    choice for about 10,000 independent frames of each kind.

    Args:
        margins: Margins of the detector, shape (n,).
        labels: Whether the person is in clear view, shape (n,), some true and some false.
        doubt: Distance of the targets from the labels, in (0, 0.5).

    Returns:
        Slope and offset, with probability = 1 / (1 + exp(-(slope margin + offset))).

    Raises:
        ValueError: All frames have the same label.
    """
    if labels.all() or not labels.any():
        raise ValueError(
            f"labels are all {bool(labels[0])}; a calibration needs frames with and without the "
            "person"
        )
    targets = np.where(labels, 1 - doubt, doubt)
    inputs = np.stack([margins, np.ones_like(margins)], axis=1)
    weights = np.zeros(2)
    for _ in range(100):
        fitted = 1 / (1 + np.exp(-inputs @ weights))
        curvature = (inputs * (fitted * (1 - fitted))[:, None]).T @ inputs
        step = np.linalg.solve(curvature, inputs.T @ (targets - fitted))
        weights += step
        if np.abs(step).max() < 1e-9:
            break
    return float(weights[0]), float(weights[1])
