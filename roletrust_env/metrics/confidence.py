"""Means over games with confidence intervals."""

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.metrics.score import mean_or_nan

Floats = npt.NDArray[np.float64]

_MANY, _NORMAL_95 = 1000, 1.959963984540054  # degrees of freedom, and Student's quantile for infinitely many


_RESAMPLES = 2000


class Estimate(NamedTuple):
    """Mean over the games in which a metric is defined.

    Attributes:
        mean: Mean.
        half: Half the width of its 95% confidence interval; NaN for a single game.
        why: Reason why the metric is undefined in some games, and the number of these games; empty if there are none.
    """

    mean: float
    half: float
    why: str = ""


class Mean(NamedTuple):
    """Means over games.

    Attributes:
        mean: Means.
        half: Half the width of their 95% confidence intervals; NaN where there are fewer than two games.
        games: Number of games in each mean.
    """

    mean: Floats
    half: Floats
    games: npt.NDArray[np.int64]


def over_games(values: Floats) -> Mean:
    """Return the mean over games, the last axis, with Student's 95% confidence interval.

    Args:
        values: Values of shape (..., E). Games with NaN are left out.
    """
    known = ~np.isnan(values)
    n = known.sum(axis=-1)
    mean = mean_or_nan(values, axis=-1)
    squares = np.where(known, (values - mean[..., None]) ** 2, 0.0).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.sqrt(squares / (n - 1) / n)
    counts, which = np.unique(n, return_inverse=True)
    quantile = np.array([student_95(int(k) - 1) for k in counts])[which].reshape(n.shape)
    return Mean(mean, np.where(n > 1, quantile * error, np.nan), n)


def estimate(per_game: Floats) -> Estimate:
    """Return the mean of one number for each game, shape (E,), which is NaN where it is undefined."""
    mean, half, _ = over_games(per_game)
    return Estimate(float(mean), float(half))


@functools.cache
def student_95(freedom: int) -> float:
    """Return the t with P(|T| < t) = 0.95 for Student's distribution; NaN without degrees of freedom.

    With T = sqrt(freedom) tan(angle), the density of the angle is proportional to cos(angle) ** (freedom - 1), which is
    integrated numerically. With many degrees of freedom the peak is too narrow for that. There, the first terms of the
    series in 1 / freedom are exact to 1e-8.

    Args:
        freedom: Degrees of freedom.

    Example:
        >>> [round(student_95(k), 3) for k in (1, 4, 30)]
        [12.706, 2.776, 2.042]
    """
    if freedom < 1:
        return math.nan
    if freedom > _MANY:
        z = _NORMAL_95
        return z + (z**3 + z) / (4 * freedom) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2)
    angle = np.linspace(0, math.pi / 2, 20_001)
    density = np.cos(angle) ** (freedom - 1)
    area = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
    return float(math.sqrt(freedom) * np.tan(np.interp(0.95, area / area[-1], angle)))


class Interval(NamedTuple):
    """Estimate and its 95% confidence interval; NaN where undefined."""

    value: float
    low: float
    high: float


def interquartile_mean(strata: Sequence[Floats], seed: int = 0) -> Interval:
    """Return the mean of the middle half of all runs, with a stratified bootstrap interval (Agarwal et al., 2021).

    The interquartile mean is less sensitive to outliers than the mean, and has less variance than the median. The
    resamples are drawn within each stratum, because differences between tasks are not random. The interval is between
    percentiles of the resamples.

    Args:
        strata: Scores of the runs of each task, shape (R,) each.
        seed: Random seed of the resamples.

    Returns:
        The mean and its interval. The interval is NaN if a stratum has a single run, and so is the mean if a stratum
        has no runs.
    """
    from scipy.stats import bootstrap, trim_mean  # type: ignore[import-untyped]

    def middle(*runs: Floats, axis: int = -1) -> Floats:
        mean: Floats = trim_mean(np.concatenate(runs, axis=axis), 0.25, axis=axis)
        return mean

    if not strata or not all(map(len, strata)):
        return Interval(math.nan, math.nan, math.nan)
    value = float(middle(*strata))
    if min(map(len, strata)) < 2:
        return Interval(value, math.nan, math.nan)
    interval = bootstrap(
        strata, middle, n_resamples=_RESAMPLES, method="percentile", vectorized=True, random_state=seed
    ).confidence_interval
    return Interval(value, float(interval.low), float(interval.high))
