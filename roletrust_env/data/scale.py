"""The scale of ratings."""

from numbers import Real

import numpy as np

from roletrust_env.trust.ledger import Floats


def check_scale(scale: tuple[float, float]) -> None:
    """Refuse a scale whose best rating is not above its worst.

    Raises:
        ValueError: The scale is no pair of numbers, is empty or not finite.
    """
    if not (
        isinstance(scale, tuple | list | np.ndarray) and len(scale) == 2 and all(isinstance(end, Real) for end in scale)
    ):
        raise ValueError(f"the scale is {scale!r}; it must be the worst and the best rating, two numbers")
    if not -np.inf < scale[0] < scale[1] < np.inf:
        raise ValueError(f"the scale is from {scale[0]:g} to {scale[1]:g}; the best rating must be above the worst")


def unit_ratings(ratings: Floats, scale: tuple[float, float]) -> Floats:
    """Return ratings on [0, 1].

    Raises:
        ValueError: A rating is not a number or is off the scale; the message gives its position, from 1.
    """
    worst, best = scale
    wrong = np.flatnonzero(~((ratings >= worst) & (ratings <= best)))
    if wrong.size:
        raise ValueError(f"rating {wrong[0] + 1} is {ratings[wrong[0]]:g}; the scale is from {worst:g} to {best:g}")
    return (ratings - worst) / (best - worst)
