"""The paper's service made real: every rater looks at every provider's camera with a people detector."""

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
    """What raters perceive of providers that are cameras (Su and Saint-Jore 2023, section 3).

    A provider's true frame is degraded by the quality it chose; each rater receives its own copy of it, and
    perceives the probability that the target is in it, by OpenCV's people detector.

    Args:
        n_raters: number of raters S.
        n_providers: number of providers P, each with a camera.
        period_s: length of a round, seconds.
        max_cycles: number of rounds of a run; a recording must last as long, unless it is looped.
        frames: none for the rendered scene; a path or camera number that all providers share; or one for each.
        loop: whether a recording that is shorter than the run begins again where it ends.
        seed: of the rendered scene and the sensor noise of bad providers.

    Attributes:
        latest: what the providers delivered at the last call, to the first game of a batch, uint8
            (P, FRAME_HEIGHT, width, 3); black before the first call, and beside frames narrower than others.

    Raises:
        ValueError: frames that cannot be had (`FramesError`), or a number of sources other than P.
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
        """How long the shortest recording is that is shown over and over, seconds; None if none is."""
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
        """The probability, for each rater and provider, that the target is in the frame.

        Args:
            quality: of each provider's frames, (P, ...), or of those for each rater, (S, P, ...), in [0, 1].
            strength: of the perturbation, (...), in [0, 1].
            round: number of the round, (...), an integer that is not negative; its time is round * period_s.
            noise: standard normals (S, P, ...). Each makes one rater's copy of one frame; nothing else is random.
            perception: must be None: a detector has no bias or scale.

        Returns:
            Probabilities (S, P, ...) in [0, 1], in the precision of the noise. Extra axes are batch; strength and
            round broadcast over them.

        Raises:
            ValueError: an argument of the wrong shape, or with values that are not allowed.
        """
        if perception is not None:
            raise ValueError("perception is not None; raters that see through a detector have no bias or scale")
        noise = np.asarray(noise)
        quality, strength, round = self._checked(quality, strength, round, noise)
        perceived = np.empty(noise.shape, np.float64)
        true_frames: dict[tuple[int, int, float], Frame] = {}
        first: list[Frame] = []
        for game in np.ndindex(*noise.shape[2:]):
            at, speed = int(round[game]), float(strength[game])
            for provider in range(self._shape[1]):
                key = (provider, at, speed)
                if key not in true_frames:
                    true_frames[key] = self._sources[provider].frame(provider, at * self._period_s, speed)
                seen: dict[float, Any] = {}
                for rater in range(self._shape[0]):
                    cell = (rater, provider, *game)
                    if (chosen := float(quality[cell])) not in seen:
                        delivered = degrade(true_frames[key], chosen, (self._seed, provider, at))
                        seen[chosen] = view(delivered)
                        if len(first) <= provider:  # of the first game, what the first rater was served
                            first.append(delivered)
                    perceived[cell] = probability(best_margin(transmit(seen[chosen], float(noise[cell]))))
        if first:
            self.latest = _stacked(first)
        return perceived.astype(noise.dtype)

    def _checked(
        self, quality: ArrayLike, strength: ArrayLike, round: ArrayLike, noise: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Quality (S, P, ...), strength (...) and round (...) over the batch of the noise, all found valid."""
        if noise.shape[:2] != self._shape or not np.issubdtype(noise.dtype, np.floating):
            raise ValueError(
                f"noise is {noise.dtype} of shape {noise.shape}; it must be floating, of shape {self._shape} "
                "(raters, providers) and then the batch"
            )
        if not np.isfinite(noise).all():
            raise ValueError("noise has values that are not finite; it must be standard normals")
        batch = noise.shape[2:]
        of_each = np.ndim(quality) == noise.ndim
        quality = _fractions("quality", quality, noise.shape if of_each else (self._shape[1], *batch))
        quality = np.broadcast_to(quality, noise.shape)
        strength = _fractions("strength", strength, batch)
        round = _spread("round", round, batch)
        if not np.issubdtype(round.dtype, np.integer) or (round < 0).any():
            raise ValueError(f"round is {_shown(round)}; it must be an integer that is not negative")
        return quality, strength, round


def _spread(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[Any]:
    """Values broadcast to a shape."""
    array = np.asarray(values)
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise ValueError(f"{name} has shape {array.shape}; it must be {shape}, or broadcast to it") from None


def _fractions(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[Any]:
    """Values in [0, 1] broadcast to a shape."""
    array = _spread(name, values, shape)
    if not ((array >= 0) & (array <= 1)).all():  # false for NaN as well
        raise ValueError(f"{name} is {_shown(array)}; every value must be a number in [0, 1]")
    return array


def _shown(array: NDArray[Any]) -> str:
    """The first few values of an array, for an error."""
    values = [str(value) for value in itertools.islice(array.flat, 6)]
    return ", ".join(values) + (", ..." if array.size > len(values) else "")


def _stacked(frames: list[Frame]) -> Frame:
    """Frames of one height in one array, the narrower ones filled up with black."""
    width = max(frame.shape[1] for frame in frames)
    return np.stack([np.pad(frame, ((0, 0), (0, width - frame.shape[1]), (0, 0))) for frame in frames])
