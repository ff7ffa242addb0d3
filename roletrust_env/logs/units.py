"""Ratings on a scale as numbers in [0, 1]."""

from collections.abc import Callable
from numbers import Real
from typing import Any

import numpy as np

from roletrust_env.trust.key_index import Floats


def check_scale(scale: tuple[float, float]) -> None:
    """Refuse a scale whose best rating is not above its worst.

    Raises:
        ValueError: The scale is not a pair of finite numbers, or is empty.
    """
    if not (
        isinstance(scale, tuple | list | np.ndarray)
        and len(scale) == 2
        and all(isinstance(end, Real) for end in scale)
    ):
        raise ValueError(
            f"the scale is {scale!r}; it must be the worst and the best rating, two numbers"
        )
    if not -np.inf < scale[0] < scale[1] < np.inf:
        raise ValueError(
            f"the scale is from {scale[0]:g} to {scale[1]:g}; the best rating must be above the "
            "worst"
        )
    if not float(scale[1]) - float(scale[0]) < np.inf:
        raise ValueError(f"the scale from {scale[0]:g} to {scale[1]:g} is too wide for a number")


def unit_ratings(
    ratings: Floats,
    scale: tuple[float, float],
    name: Callable[[int], str] = lambda at: f"rating {at + 1} is",
) -> Floats:
    """Return ratings on [0, 1], 0 for the worst.

    Args:
        ratings: Ratings, shape (n,).
        scale: Worst and best rating.
        name: Function from a place among the ratings to the beginning of an error message.

    Raises:
        ValueError: A rating is not a number or is off the scale. The message names the first one.
    """
    worst, best = scale
    if not (right := (ratings >= worst) & (ratings <= best)).all():
        at = int(right.argmin())
        raise ValueError(
            f"{name(at)} {number_text(ratings[at])}, off the scale from {worst:g} to {best:g}"
        )
    unit = ratings - worst
    unit /= best - worst
    return unit


def number_text(number: Any) -> str:
    """Return a number with all its digits, and a whole one without a point."""
    return repr(float(number)).removesuffix(".0")
