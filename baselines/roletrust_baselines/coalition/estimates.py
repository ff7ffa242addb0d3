"""Estimates of the providers' qualities by a rater without noise of its own, and their ranks."""

from typing import NamedTuple, Self

from roletrust_env.arrays import Array, cast, mean_places, namespace
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random

STEPS = 1e6
"""Number of steps of [0, 1] that ranks tell apart, so that the rounding of means does not order equal providers."""


class Estimates(NamedTuple):
    """Memory of a rater: its running mean of the perceived quality of each provider.

    Attributes:
        total: Sum of the perceived qualities, shape (P, ...).
        count: Number of perceived services, shape (P, ...).
    """

    total: Array
    count: Array

    @classmethod
    def nothing(cls, random: Random, shape: tuple[int, ...]) -> Self:
        """Return the memory before the first service.

        The number of providers is not known yet. Its axis has the length 1, which also suits the reset of single games
        of a batch.

        Args:
            random: Random numbers with the array library, dtype and device of the game; none is drawn.
            shape: Shape of the agents and the batch.
        """
        like = random.like
        nothing = namespace(like).zeros((1, *shape), dtype=like.dtype, device=like.device)
        return cls(nothing, nothing)

    def after(self, view: RaterView) -> Self:
        """Return the memory with the services that await a rating."""
        perceived = cast(view.awaiting, view.service.dtype)
        return type(self)(self.total + perceived * view.service, self.count + perceived)

    def means(self, unknown: Array) -> Array:
        """Return the mean perceived quality of each provider; `unknown` where nothing was perceived."""
        known = self.count > 0
        return namespace(unknown).where(known, self.total / (self.count + ~known), unknown)


def ranks(values: Array, left_out: Array | None = None) -> Array:
    """Return the ranks of the providers, 0 for the highest value and 1 for the lowest. Equal values share a mean rank.

    Args:
        values: Values in [0, 1], shape (P, ...).
        left_out: Mask of the providers that are not ranked, shape (P, 1 ...); their rank is 1.

    Example:
        >>> import numpy as np
        >>> ranks(np.array([0.5, 0.9, 0.2, 0.9, 0.7]))
        array([0.75 , 0.125, 1.   , 0.125, 0.5  ])
    """
    xp = namespace(values)
    ranked, steps = values.shape[0], xp.round(values * STEPS)
    if left_out is not None:
        ranked, steps = ranked - int(left_out.sum()), xp.where(left_out, 0 * steps - 1, steps)
    return xp.clip(mean_places(steps) / max(ranked - 1, 1), 0, 1)
