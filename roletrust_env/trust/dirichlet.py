"""Levels of ratings, for models that learn a Dirichlet distribution of how often each level occurs.

The levels are equally spaced in [0, 1]. A rating between two levels counts as a part of an
observation of each, more of the nearer one, so that its mean level is the rating. With two levels,
f counts as f of a success and 1 - f of a failure.
"""

from typing import Annotated

from roletrust_env.arrays import Array, device_of, namespace, total
from roletrust_env.shapes import PerPair, Shape
from roletrust_env.trust.ratings import Ratings


def level_values(levels: int, like: PerPair) -> Array:
    """Return the rating that each level stands for, shape (levels, 1, ...), to broadcast with (S,
    levels, P, ...).

    Args:
        levels: Number of levels, at least 2.
        like: Array of shape (S, P, ...) that shows the number of axes, the dtype and the array
            library.
    """
    xp, ones = namespace(like), [1] * (like.ndim - 1)
    values = xp.asarray(
        [x / (levels - 1) for x in range(levels)], dtype=like.dtype, device=device_of(like)
    )
    return xp.reshape(values, (levels, *ones))


def in_levels(ratings: Ratings, levels: int) -> Annotated[Array, Shape("S levels P ...")]:
    """Return the part of an observation of each level that each rating is, shape (S, levels, P,
    ...), 0 without one.

    Args:
        ratings: Ratings of the round, on a grid.
        levels: Number of levels, at least 2.

    Example:
        >>> import numpy as np
        >>> in_levels(Ratings(np.array([[0.5, 0.625, 1.0]])), 3)[0].T.tolist()
        [[0.0, 1.0, 0.0], [0.0, 0.75, 0.25], [0.0, 0.0, 1.0]]
    """
    values, weights = ratings.values[:, None, ...], ratings.weights[:, None, ...]
    steps = (levels - 1) * abs(values - level_values(levels, ratings.values))
    return weights * namespace(steps).clip(1 - steps, 0.0, None)


def expected_level(evidence: Annotated[Array, Shape("S levels P ...")], values: Array) -> PerPair:
    """Return the mean rating under the Dirichlet distributions of each pair, shape (S, P, ...), in
    [0, 1].

    Args:
        evidence: Parameters of the distributions, above 0, shape (S, levels, P, ...).
        values: Rating that each level stands for, see `level_values`.
    """
    return namespace(evidence).clip(total(values * evidence, 1) / total(evidence, 1), 0.0, 1.0)
