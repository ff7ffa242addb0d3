"""From the quality that a provider chose to the quality that each rater perceives."""

from typing import Any, Protocol

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.world.heterogeneity import Perception
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario


class Service(Protocol):
    """What lies between a provider's quality and a rater's perception of it."""

    def perceive(self, quality: Array, strength: Array, round: Array, noise: Array, taste: Perception | None) -> Array:
        """The quality that each rater perceives in each service.

        Args:
            quality: as delivered, shape (P, ...), or to each rater, (S, P, ...), in [0, 1].
            strength: of the perturbation that strikes all services, shape (...), in [0, 1].
            round: number of the round, shape (...).
            noise: standard normal, shape (S, P, ...).
            taste: the raters' own bias and scale; None where they have none.

        Returns:
            Perceived quality, shape (S, P, ...), in [0, 1].
        """
        ...


class SyntheticService:
    """Perceived quality is delivered quality, dimmed by perturbations, plus the rater's Gaussian noise, clipped.

    A rater with a bias and a scale of its own perceives scale x quality + bias + noise, clipped: it is subjective, and
    not dishonest.

    Args:
        roster: whose raters have their perception noise.
        like: an array of the library, dtype and device to work with.
    """

    def __init__(self, roster: Roster, like: Array) -> None:
        def constant(values: Any) -> Array:
            return namespace(like).asarray(values, dtype=like.dtype, device=like.device)

        noise = roster.raters(np.asarray([group.noise for group in roster.groups]))
        alike = bool((noise == noise[0]).all())
        self._deviation = constant(noise[0] if alike else noise[:, None])
        # Arrays, since numbers cost twice as much as small arrays; so does `clip`.
        self._bounds = constant(0), constant(1)

    def perceive(self, quality: Array, strength: Array, round: Array, noise: Array, taste: Perception | None) -> Array:
        """See `Service.perceive`."""
        deviation = self._deviation
        if deviation.ndim and noise.ndim > 2:
            deviation = deviation.reshape(deviation.shape + (1,) * (noise.ndim - 2))
        xp, (least, most) = namespace(noise), self._bounds
        seen = quality * (1 - strength)
        if taste is not None:
            seen = taste.scale[:, None, ...] * seen + taste.bias[:, None, ...]
        return xp.minimum(xp.maximum(seen + deviation * noise, least), most)


def make_service(scenario: Scenario, roster: Roster, like: Array) -> Service:
    """The service of a scenario; OpenCV is imported only for one that looks at camera frames."""
    if scenario.service == "synthetic":
        return SyntheticService(roster, like)
    if not isinstance(like, np.ndarray):
        raise ValueError("the service 'hog' is NumPy's; it cannot be played with arrays of another library")
    try:
        from roletrust_env.world.vision import HogService
    except ImportError as error:
        raise ValueError(f"the service 'hog' needs OpenCV ({error}): pip install 'roletrust-env[vision]'") from None

    return HogService(
        roster.n_raters,
        roster.n_providers,
        period_s=scenario.period_s,
        max_cycles=scenario.max_cycles,
        frames=scenario.frames,
        loop=scenario.playback == "loop",
    )
