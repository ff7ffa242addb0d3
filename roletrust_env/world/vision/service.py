"""Service of the paper: every rater looks at the camera of every provider with a people detector."""

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roletrust_env.world.heterogeneity import Perception
from roletrust_env.world.vision.camera import FRAME_HEIGHT, FRAME_WIDTH, Frame
from roletrust_env.world.vision.degrade import degrade, transmit
from roletrust_env.world.vision.detector import best_margin, probability, view
from roletrust_env.world.vision.frames import CapturedFrames, open_frames

__all__ = ["HogService"]


class HogService:
    """Service in which providers are cameras and raters detect people (Su and Saint-Jore 2023, section 3).

    The true frame of a provider is degraded according to the quality that it chose. Each rater receives its own copy,
    and perceives the probability that the target is in it, by OpenCV's people detector.

    Args:
        n_raters: Number of raters S.
        n_providers: Number of providers P, each with a camera.
        period_s: Length of a round, seconds.
        max_cycles: Number of rounds of a run. A video or image folder must last as long, unless it is looped.
        frames: None for the rendered scene; a path or camera number for all providers; or one path for each.
        loop: Whether a video or image folder that is shorter than the run starts again.
        seed: Random seed of the rendered scene and of the sensor noise of bad providers.

    Attributes:
        latest: Frames that the providers delivered in the last call, in the first game of a batch, uint8, shape
            (P, FRAME_HEIGHT, width, 3). They are black before the first call. Narrow frames are padded with black.

    Raises:
        ValueError: Frames cannot be read (`FramesError`), or the number of sources is not P.
    """

    def __init__(
        self,
        n_raters: int,
        n_providers: int,
        *,
        period_s: float,
        max_cycles: int,
        frames: str | Path | int | Sequence[str] | None = None,
        loop: bool = False,
        seed: int = 0,
    ) -> None:
        self._shape = (n_raters, n_providers)
        self._period_s = period_s
        self._seed = seed
        duration_s = period_s * max_cycles
        if frames is None or isinstance(frames, str | Path | int):
            shared = open_frames(frames, duration_s=duration_s, period_s=period_s, seed=seed, loop=loop)
            self._sources = [shared] * n_providers
        elif len(frames) != n_providers:
            raise ValueError(
                f"frames names {len(frames)} sources; allowed are one for all, or {n_providers}, one per provider"
            )
        else:
            self._sources = [open_frames(one, duration_s=duration_s, period_s=period_s, loop=loop) for one in frames]
        self.latest: Frame = np.zeros((n_providers, FRAME_HEIGHT, FRAME_WIDTH, 3), np.uint8)

    @property
    def loop_length_s(self) -> float | None:
        """Length of the shortest looped video or image folder, in seconds; None if none is looped."""
        lengths = [source.loop_length_s for source in self._sources if isinstance(source, CapturedFrames)]
        return min((length for length in lengths if length is not None), default=None)

    def perceive(
        self,
        quality: ArrayLike,
        strength: ArrayLike,
        round: ArrayLike,
        noise: ArrayLike,
        perception: Perception | None = None,
    ) -> NDArray[np.floating[Any]]:
        """Return the probability that the target is in the frame, for each rater and provider.

        Args:
            quality: Quality of the frames of each provider, shape (P, ...), or for each rater, shape (S, P, ...), in
                [0, 1].
            strength: Strength of the perturbation in [0, 1], shape (...).
            round: Number of the round, shape (...), an integer of 0 or more. Its time is round * period_s.
            noise: Standard normal noise, shape (S, P, ...). Each number makes the copy of one frame for one rater;
                nothing else is random.
            perception: None; a detector has no bias or scale.

        Returns:
            Probabilities in [0, 1], shape (S, P, ...), in the precision of the noise. Further axes are batch axes, over
            which strength and round are broadcast.

        Raises:
            ValueError: An argument has the wrong shape, or values that are not allowed.
        """
        if perception is not None:
            raise ValueError("perception is not None; raters that see through a detector have no bias or scale")
        noise = np.asarray(noise)
        quality, strength, round = self._check(quality, strength, round, noise)
        perceived = np.empty(noise.shape, np.float64)
        true_frames: dict[tuple[int, int, float], Frame] = {}
        first: list[Frame] = []
        for game in np.ndindex(*noise.shape[2:]):
            at, speed = int(round[game]), float(strength[game])
            for provider in range(self._shape[1]):
                key = (provider, at, speed)
                if key not in true_frames:
                    true_frames[key] = self._sources[provider].frame(provider, at * self._period_s, speed)
                views: dict[float, Any] = {}
                for rater in range(self._shape[0]):
                    cell = (rater, provider, *game)
                    if (chosen := float(quality[cell])) not in views:
                        delivered = degrade(true_frames[key], chosen, (self._seed, provider, at))
                        views[chosen] = view(delivered)
                        if len(first) <= provider:  # the frame for the first rater in the first game
                            first.append(delivered)
                    perceived[cell] = probability(best_margin(transmit(views[chosen], float(noise[cell]))))
        if first:
            self.latest = _stack_padded(first)
        return perceived.astype(noise.dtype)

    def _check(
        self, quality: ArrayLike, strength: ArrayLike, round: ArrayLike, noise: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Validate quality, strength and round, and return them broadcast to (S, P, ...), (...) and (...)."""
        if noise.shape[:2] != self._shape or not np.issubdtype(noise.dtype, np.floating):
            raise ValueError(
                f"noise is {noise.dtype} of shape {noise.shape}; it must be floating, of shape {self._shape} "
                "(raters, providers) and then the batch"
            )
        if not np.isfinite(noise).all():
            raise ValueError("noise has values that are not finite; it must be standard normals")
        batch = noise.shape[2:]
        for_each_rater = np.ndim(quality) == noise.ndim
        quality = _broadcast_shares("quality", quality, noise.shape if for_each_rater else (self._shape[1], *batch))
        quality = np.broadcast_to(quality, noise.shape)
        strength = _broadcast_shares("strength", strength, batch)
        round = _broadcast("round", round, batch)
        if not np.issubdtype(round.dtype, np.integer) or (round < 0).any():
            raise ValueError(f"round is {_excerpt(round)}; it must be an integer that is not negative")
        return quality, strength, round


def _broadcast(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return values broadcast to a shape."""
    array = np.asarray(values)
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise ValueError(f"{name} has shape {array.shape}; it must be {shape}, or broadcast to it") from None


def _broadcast_shares(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return values broadcast to a shape, and refuse values outside [0, 1]."""
    array = _broadcast(name, values, shape)
    if not ((array >= 0) & (array <= 1)).all():  # also refuses NaN
        raise ValueError(f"{name} is {_excerpt(array)}; every value must be a number in [0, 1]")
    return array


def _excerpt(array: NDArray[Any]) -> str:
    """Return the first few values of an array, for an error message."""
    values = [str(value) for value in itertools.islice(array.flat, 6)]
    return ", ".join(values) + (", ..." if array.size > len(values) else "")


def _stack_padded(frames: list[Frame]) -> Frame:
    """Return frames of the same height in one array, with narrow frames padded with black."""
    width = max(frame.shape[1] for frame in frames)
    return np.stack([np.pad(frame, ((0, 0), (0, width - frame.shape[1]), (0, 0))) for frame in frames])
