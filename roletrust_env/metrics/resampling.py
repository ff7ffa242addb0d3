"""Measures with weights, and intervals that resample whole users or tasks."""

from collections.abc import Callable

import numpy as np

from roletrust_env.metrics.confidence import Interval
from roletrust_env.randomness import generator
from roletrust_env.trust.key_index import Floats, Ints

RESAMPLES = 400
"""Number of resamples of an interval."""


def interval(
    measure: Callable[[Floats], float], groups: Ints, seed: int = 0, resamples: int = RESAMPLES
) -> Interval:
    """Return a measure, and its 95% interval from a bootstrap that draws whole groups with
    replacement.

    The ratings of a user are not independent, so that an interval over single ratings would be too
    narrow.

    Args:
        measure: Function from weights of the values, shape (n,), to the measure; NaN where it is
            undefined.
        groups: Number of the group of each value, such as its user or task, shape (n,), at least 0.
        seed: Random seed of the resamples.
        resamples: Number of resamples.
    """
    rng, (_, places) = generator(seed), np.unique_inverse(groups)
    many = int(places.max(initial=-1)) + 1
    value = measure(np.ones(len(groups)))
    if many < 2:
        return Interval(value, np.nan, np.nan)
    draws = (np.bincount(rng.integers(0, many, many), minlength=many) for _ in range(resamples))
    found = np.array([measure(draw[places].astype(np.float64)) for draw in draws])
    found = found[~np.isnan(found)]
    low, high = np.percentile(found, [2.5, 97.5]) if len(found) else (np.nan, np.nan)
    return Interval(value, float(low), float(high))


def mean_intervals(table: Floats, seed: int = 0, resamples: int = RESAMPLES) -> list[Interval]:
    """Return the mean of each column over the rows, which are the groups, with its 95% interval.
    See `interval`.
    """
    many = len(table)
    means = table.mean(axis=0)
    if many < 2:
        return [Interval(value, np.nan, np.nan) for value in means.tolist()]
    draws = generator(seed).integers(0, many, (resamples, many))
    low, high = np.percentile(table[draws].mean(axis=1), [2.5, 97.5], axis=0)
    return [
        Interval(*ends) for ends in zip(means.tolist(), low.tolist(), high.tolist(), strict=True)
    ]


def auc(score: Floats, bad: Floats) -> Callable[[Floats], float]:
    """Return a function from weights to the area under the ROC curve: the bad have lower scores
    than the others.

        auc = pairs (bad, other) with score[bad] < score[other], ties half / number of pairs

    Args:
        score: Score of each value, shape (n,).
        bad: 1 for each bad value and 0 for the others, shape (n,).
    """
    _, rank = np.unique_inverse(score)
    size = int(rank.max(initial=-1)) + 1

    def area(weights: Floats) -> float:
        low = np.bincount(rank, weights * bad, size)
        high = np.bincount(rank, weights * (1 - bad), size)
        pairs = low.sum() * high.sum()
        won = (high * (np.cumsum(low) - low / 2)).sum()
        return float(won / pairs) if pairs > 0 else float("nan")

    return area


def correlation(one: Floats, other: Floats) -> Callable[[Floats], float]:
    """Return a function from weights to Pearson's correlation of two arrays of shape (n,); NaN if
    undefined.
    """

    def pearson(weights: Floats) -> float:
        if not weights.any():
            return float("nan")
        x, y = (values - np.average(values, weights=weights) for values in (one, other))
        spread = np.sqrt((weights * x * x).sum() * (weights * y * y).sum())
        return float((weights * x * y).sum() / spread) if spread > 1e-12 else float("nan")

    return pearson


def mean(values: Floats) -> Callable[[Floats], float]:
    """Return a function from weights to the mean of values of shape (n,); NaN without values."""
    return lambda weights: float(np.average(values, weights=weights)) if weights.any() else np.nan


def ranks(values: Floats) -> Floats:
    """Return the share of values below each value, ties half, shape (n,): a percentile in (0,
    1).
    """
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    return ((np.cumsum(counts) - counts / 2) / len(values))[place]
