"""Services: from the quality that a provider delivers to the quality that each rater perceives,
and the perturbations that reduce it.
"""

from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.world.heterogeneity import Perception
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Perturbation, Scenario


class Service(Protocol):
    """Protocol of services: they turn the quality of providers into the perception of raters."""

    def perceive(
        self,
        quality: Array,
        strength: Array,
        round: Array,
        noise: Array,
        perception: Perception | None,
    ) -> Array:
        """Return the quality that each rater perceives in each service.

        Args:
            quality: Delivered quality in [0, 1], shape (P, ...), or for each rater, shape (S, P,
                ...).
            strength: Strength of the perturbation in [0, 1], shape (...).
            round: Number of the round, shape (...).
            noise: Standard normal noise, shape (S, P, ...).
            perception: Bias and scale of the raters; None if they have none.

        Returns:
            Perceived quality in [0, 1], shape (S, P, ...).
        """


class SyntheticService:
    """Service in which a rater perceives the delivered quality, reduced by perturbations, plus
    noise, clipped.

    A rater with a bias and a scale perceives scale x quality + bias + noise, clipped. Such a rater
    is subjective, but not dishonest.

    Args:
        roster: Agents with the perception noise of the raters.
        like: Array of the library, dtype and device to work with.
    """

    def __init__(self, roster: Roster, like: Array) -> None:
        def constant(values: Any) -> Array:
            return namespace(like).asarray(values, dtype=like.dtype, device=like.device)

        noise = roster.raters(roster.of_groups(lambda group: group.noise))
        all_equal = bool((noise == noise[0]).all())
        self._deviation = constant(noise[0] if all_equal else noise[:, None])
        # Arrays, because Python numbers take twice the time of small arrays, and so does `clip`.
        self._bounds = constant(0), constant(1)

    def perceive(
        self,
        quality: Array,
        strength: Array,
        round: Array,
        noise: Array,
        perception: Perception | None,
    ) -> Array:
        """See `Service.perceive`."""
        deviation = self._deviation
        if deviation.ndim and noise.ndim > 2:
            deviation = deviation.reshape(deviation.shape + (1,) * (noise.ndim - 2))
        xp, (low, high) = namespace(noise), self._bounds
        perceived = quality * (1 - strength)
        if perception is not None:
            perceived = perception.scale[:, None, ...] * perceived + perception.bias[:, None, ...]
        return xp.minimum(xp.maximum(perceived + deviation * noise, low), high)


class Perturbations:
    """Perturbations of a scenario. Where several overlap, the strongest one counts.

    Args:
        scenario: Scenario with the perturbations.
        like: Array of the library, dtype and device to work with.
    """

    def __init__(self, scenario: Scenario, like: Array) -> None:
        xp = namespace(like)
        table = np.zeros(scenario.max_cycles)
        for perturbation in scenario.perturbations:
            rounds = slice(perturbation.start, perturbation.stop)
            table[rounds] = np.maximum(table[rounds], perturbation.strength)
        self._table = xp.asarray(table, dtype=like.dtype, device=like.device)

    def strength(self, round: Array) -> Array:
        """Return the strength in each round; rounds and strengths have the same shape (...)."""
        return self._table[round[None]][0]  # compiled torch refuses an index without axes


def strength_in(perturbations: Iterable[Perturbation], round: int) -> float:
    """Return the strength in one round, which may be beyond the length of the game."""
    return max(
        (
            perturbation.strength
            for perturbation in perturbations
            if perturbation.start <= round < perturbation.stop
        ),
        default=0.0,
    )


def make_service(scenario: Scenario, roster: Roster, like: Array) -> Service:
    """Return the service of a scenario. OpenCV is imported only for the service `hog`."""
    if scenario.service == "synthetic":
        return SyntheticService(roster, like)
    if not isinstance(like, np.ndarray):
        raise ValueError(
            "the service 'hog' needs NumPy; it does not support arrays of another library"
        )
    try:
        from roletrust_env.world.vision.service import HogService
    except ImportError as error:
        raise ValueError(
            f"the service 'hog' needs OpenCV ({error}): pip install 'roletrust-env[vision]'"
        ) from None

    return HogService(
        roster.n_raters,
        roster.n_providers,
        period_s=scenario.period_s,
        max_cycles=scenario.max_cycles,
        frames=scenario.frames,
        loop=scenario.playback == "loop",
    )
