"""Means over games, and how sure they are."""

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
    """A mean over games, and half the width of its 95% confidence interval, NaN for one game.

    It is over the games in which it is defined; `why` says why it is undefined in others, and in how many.
    """

    mean: float
    half: float
    why: str = ""


class Mean(NamedTuple):
    """Means over games, and half the width of their 95% intervals: NaN where there are not two games."""

    mean: Floats
    half: Floats
    games: npt.NDArray[np.int64]


def over_games(values: Floats) -> Mean:
    """The mean over the last axis, games, with Student's 95% confidence interval.

    Args:
        values: shape (..., E); a game that has none (NaN) is left out.
    """
    there = ~np.isnan(values)
    n = there.sum(axis=-1)
    mean = mean_or_nan(values, axis=-1)
    squares = np.where(there, (values - mean[..., None]) ** 2, 0.0).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.sqrt(squares / (n - 1) / n)
    counts, which = np.unique(n, return_inverse=True)
    quantile = np.array([student_95(int(k) - 1) for k in counts])[which].reshape(n.shape)
    return Mean(mean, np.where(n > 1, quantile * error, np.nan), n)


def estimate(per_game: Floats) -> Estimate:
    """The mean of one number for each game, (E,), NaN where a game has none."""
    mean, half, _ = over_games(per_game)
    return Estimate(float(mean), float(half))


@functools.cache
def student_95(freedom: int) -> float:
    """The t with P(|T| < t) = 0.95 for Student's distribution; NaN without a degree of freedom.

    With T = sqrt(freedom) tan(angle), the density of the angle is proportional to cos(angle) ** (freedom - 1). For many
    degrees it is too narrow a peak for a sum; there the first terms of the series in 1 / freedom are exact to 1e-8.

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
    """An estimate and its 95% interval; NaN where it is undefined."""

    value: float
    low: float
    high: float


def interquartile_mean(strata: Sequence[Floats], seed: int = 0) -> Interval:
    """The mean of the middle half of all runs, with a stratified bootstrap interval (Agarwal et al., 2021).

    It minds outliers less than the mean, and is surer than the median. The resamples are drawn from each stratum apart,
    for what differs between tasks is no luck; the interval is that of their percentiles.

    Args:
        strata: the runs of each task, (R,) each.
        seed: of the resamples.

    Returns:
        No interval where a stratum has one run only; nothing where there is none.
    """
    from scipy.stats import bootstrap, trim_mean  # type: ignore[import-untyped]

    def middle(*runs: Floats, axis: int = -1) -> Floats:
        found: Floats = trim_mean(np.concatenate(runs, axis=axis), 0.25, axis=axis)
        return found

    if not strata or not all(map(len, strata)):
        return Interval(math.nan, math.nan, math.nan)
    value = float(middle(*strata))
    if min(map(len, strata)) < 2:
        return Interval(value, math.nan, math.nan)
    found = bootstrap(
        strata, middle, n_resamples=_RESAMPLES, method="percentile", vectorized=True, random_state=seed
    ).confidence_interval
    return Interval(value, float(found.low), float(found.high))
