"""Service of the paper: every rater looks at the camera of every provider with a people
detector.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roletrust_env.world.heterogeneity import Perception
from roletrust_env.world.vision.camera import FRAME_HEIGHT, FRAME_WIDTH, Frame
from roletrust_env.world.vision.degrade import degrade, transmit
from roletrust_env.world.vision.detector import best_margin, detector_view, probability
from roletrust_env.world.vision.frames import CapturedFrames, open_frames


class HogService:
    """Service in which providers are cameras and raters detect people (Su and Saint-Jore 2023,
    section 3).

    The true frame of a provider is degraded according to the quality that it chose. Each rater
    receives its own copy, and perceives the probability that the target is in it, by OpenCV's
    people detector.

    Args:
        n_raters: Number of raters S.
        n_providers: Number of providers P, each with a camera.
        period_s: Length of a round, seconds.
        max_cycles: Number of rounds of a run. A video or image folder must last as long, unless it
            is looped.
        frames: Source of the frames of all providers, see `open_frames`; None for the rendered
            scene.
        loop: Whether a video or image folder that is shorter than the run starts again.

    Attributes:
        latest: Frames that the providers delivered in the last call, in the first game of a batch,
            uint8, shape (P, FRAME_HEIGHT, width, 3). They are black before the first call.

    Raises:
        FramesError: Frames cannot be read.
    """

    def __init__(
        self,
        n_raters: int,
        n_providers: int,
        *,
        period_s: float,
        max_cycles: int,
        frames: str | Path | int | None = None,
        loop: bool = False,
    ) -> None:
        self._shape = (n_raters, n_providers)
        self._period_s = period_s
        self._source = open_frames(
            frames, duration_s=period_s * max_cycles, period_s=period_s, loop=loop
        )
        self.latest: Frame = np.zeros((n_providers, FRAME_HEIGHT, FRAME_WIDTH, 3), np.uint8)

    @property
    def loop_length_s(self) -> float | None:
        """Length of the looped video or image folder, in seconds; None if it is not looped."""
        return self._source.loop_length_s if isinstance(self._source, CapturedFrames) else None

    def perceive(
        self,
        quality: ArrayLike,
        strength: ArrayLike,
        round: ArrayLike,
        noise: ArrayLike,
        perception: Perception | None = None,
    ) -> NDArray[np.floating[Any]]:
        """Return the probability that the target is in the frame, for each rater and provider. See
        `Service.perceive`.

        Args:
            quality: Quality of the frames of each provider, or for each rater.
            strength: Strength of the perturbation.
            round: Number of the round. Its time is round * period_s.
            noise: Standard normal noise, shape (S, P, ...). Each number makes the copy of one frame
                for one rater; nothing else is random.
            perception: None; a detector has no bias or scale.

        Returns:
            Probabilities in [0, 1], shape (S, P, ...), in the precision of the noise. Further axes
            are batch axes, over which quality, strength and round are broadcast.

        Raises:
            ValueError: Raters have a bias or a scale.
        """
        if perception is not None:
            raise ValueError(
                "perception is not None; raters that see through a detector have no bias or scale"
            )
        noise = np.asarray(noise)
        batch, for_each_rater = noise.shape[2:], np.ndim(quality) == noise.ndim
        of_providers = np.broadcast_to(quality, noise.shape if for_each_rater else noise.shape[1:])
        quality, strength, round = (
            np.broadcast_to(of_providers, noise.shape),
            np.broadcast_to(strength, batch),
            np.broadcast_to(round, batch),
        )
        perceived = np.empty(noise.shape, np.float64)
        true_frames: dict[tuple[int, int, float], Frame] = {}
        first: list[Frame] = []
        for game in np.ndindex(*batch):
            at, speed = int(round[game]), float(strength[game])
            for provider in range(self._shape[1]):
                key = (provider, at, speed)
                if key not in true_frames:
                    true_frames[key] = self._source.frame(provider, at * self._period_s, speed)
                views: dict[float, Any] = {}
                for rater in range(self._shape[0]):
                    cell = (rater, provider, *game)
                    if (chosen := float(quality[cell])) not in views:
                        delivered = degrade(true_frames[key], chosen, (0, provider, at))
                        views[chosen] = detector_view(delivered)
                        if (
                            len(first) <= provider
                        ):  # the frame for the first rater in the first game
                            first.append(delivered)
                    perceived[cell] = probability(
                        best_margin(transmit(views[chosen], float(noise[cell])))
                    )
        if first:
            self.latest = np.stack(first)
        return perceived.astype(noise.dtype)
