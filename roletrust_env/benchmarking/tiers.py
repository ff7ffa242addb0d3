"""Tiers: models that are not significantly different from the best one of their tier."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.metrics.confidence import over_seeds, student_quantile

Floats = npt.NDArray[np.float64]

_DIGITS = 9
"""Number of decimal digits in which means are compared. Smaller differences are rounding errors."""

_LEVEL = 0.95


class _Pairs(NamedTuple):
    """Differences between the mean scores of models in the same games and seeds, each of shape (M,
    M).

    Attributes:
        difference: Score of the first model minus that of the second one.
        error: Standard error of the difference.
        freedom: Degrees of freedom of the error.
    """

    difference: Floats
    error: Floats
    freedom: Floats


def tiers(scores: Floats) -> list[int]:
    """Return the tier of each model, which counts from 1.

    The best model without a tier leads the next tier, which reaches down to the last model that is
    not significantly different from it.

    Args:
        scores: Scores of the models, the best one first, in the same games of the same seeds, shape
            (M, S, G).
    """
    if not len(scores):
        return []
    number = len(scores)
    equal = _not_different(_pairs(scores), tests=max(1, number * (number - 1) // 2))
    found: list[int] = []
    while len(found) < number:
        leader = len(found)
        last = int(np.flatnonzero(equal[leader]).max())
        found += [1 + max(found, default=0)] * (last + 1 - leader)
    return found


def _pairs(scores: Floats) -> _Pairs:
    number = len(scores)
    above, below = np.triu_indices(number, 1)
    estimates = over_seeds(scores[above] - scores[below], number - 1)
    square = np.zeros((3, number, number))
    square[:, above, below] = estimates
    square[:, below, above] = -estimates.mean, estimates.error, estimates.freedom
    return _Pairs(*square)


def _not_different(pairs: _Pairs, tests: int) -> npt.NDArray[np.bool_]:
    """Return which models are not significantly different, shape (M, M).

    Two models are significantly different if Student's paired test rejects that their scores are
    equal. By Bonferroni's correction for all pairs, any two models with equal scores are different
    in at most 5% of runs. Tiers need all of them, because the leader of a tier is the best one by
    the same games; the honestly significant differences of Tukey are one family for the same
    reason.

    Args:
        pairs: Differences between the models.
        tests: Number of tests that share the error of 5%.
    """
    level = 1 - (1 - _LEVEL) / tests
    limit = student_quantile(pairs.freedom, level) * pairs.error + 10.0**-_DIGITS
    equal: npt.NDArray[np.bool_] = ~(
        abs(pairs.difference) > limit
    )  # also where the error is unknown
    return equal
