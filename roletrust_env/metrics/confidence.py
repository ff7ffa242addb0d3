"""Means over games and seeds with confidence intervals."""

import functools
import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.metrics.score import mean_or_nan, ratio
from roletrust_env.shapes import Shape

Floats = npt.NDArray[np.float64]

_MANY = 1000
"""Degrees of freedom above which the peak of Student's distribution is too narrow to be
integrated."""

_RESAMPLES = 2000

_PRIOR_SHARE = 0.5
"""Share of the degrees of freedom of a prior that count.

True variances need not scatter as the prior says. This share keeps the level of the tests for tiers
where the variance between seeds differs from model to model, see
`tests/benchmarking/test_verdict.py`.
"""


class Interval(NamedTuple):
    """Estimate and its 95% confidence interval; NaN where undefined."""

    value: float
    low: float
    high: float


class Estimate(NamedTuple):
    """Mean over the games in which a metric is defined.

    Attributes:
        mean: Mean.
        half: Half the width of its 95% confidence interval; NaN for a single game.
        why: Reason why the metric is undefined in some games, and the number of these games; empty
            if there are none.
    """

    mean: float
    half: float
    why: str = ""

    @property
    def interval(self) -> Interval:
        """Mean with both ends of its interval."""
        return Interval(self.mean, self.mean - self.half, self.mean + self.half)


class GameMean(NamedTuple):
    """Means over games.

    Attributes:
        mean: Means.
        half: Half the width of their 95% confidence intervals; NaN where there are fewer than two
            games.
        games: Number of games in each mean.
    """

    mean: Floats
    half: Floats
    games: npt.NDArray[np.int64]


def over_games(values: Floats) -> GameMean:
    """Return the mean over games, the last axis, with Student's 95% confidence interval.

    Args:
        values: Values of shape (..., E). Games with NaN are left out.
    """
    mean, variance, n = _moments(values)
    return GameMean(mean, student_quantile(n - 1) * np.sqrt(ratio(variance, n)), n)


def estimate(per_game: Floats) -> Estimate:
    """Return the mean of one number for each game, shape (E,), which is NaN where it is
    undefined.
    """
    mean, half, _ = over_games(per_game)
    return Estimate(float(mean), float(half))


class SeedMean(NamedTuple):
    """Means over the games of several seeds.

    Attributes:
        mean: Means, shape (N,).
        error: Standard errors of the means, shape (N,); NaN where they are unknown.
        freedom: Degrees of freedom of the standard errors, shape (N,).
    """

    mean: Annotated[Floats, Shape("N")]
    error: Annotated[Floats, Shape("N")]
    freedom: Annotated[Floats, Shape("N")]

    @property
    def estimates(self) -> list[Estimate]:
        """Means with half their 95% confidence intervals."""
        halves = student_quantile(self.freedom) * self.error
        return [
            Estimate(float(mean), float(half)) for mean, half in zip(self.mean, halves, strict=True)
        ]


def over_seeds(values: Annotated[Floats, Shape("N S G")], independent: int) -> SeedMean:
    """Return the means over the games of some seeds, with their errors as estimates of runs with
    new seeds.

    A seed searches and chooses attacks, and then plays its games. So the means of seeds differ by
    more than the noise of games. With two or three seeds, the variance between the seeds of a
    single mean is hardly known. It is moderated by a prior, as in limma (Smyth 2004, Statistical
    Applications in Genetics and Molecular Biology 3): the prior variance is the noise of the games
    of that mean, plus the additional variance that the N means have on average. The own estimate
    has S - 1 degrees of freedom, and the prior has a number that depends on how much the own
    estimates scatter about it. A single mean has no prior. With a single seed only the noise of
    games is known.

    Args:
        values: Values of N means in G games of each of S seeds, shape (N, S, G). Games with NaN are
            left out.
        independent: Number of the means that do not follow from others: N for scores of N models, N
            - 1 for all the differences between them.
    """
    by_seed, within, games = _moments(values)
    noise = ratio(within, games)
    if values.shape[1] == 1:
        return SeedMean(by_seed[:, 0], np.sqrt(noise[:, 0]), games[:, 0].astype(np.float64) - 1)
    mean, between, seeds = _moments(by_seed)
    noise = mean_or_nan(noise, axis=1)
    excess = float(mean_or_nan(between - noise, axis=0))
    prior = noise + max(0.0, excess)
    weight = _prior_freedom(ratio(between, prior), values.shape[1] - 1, independent)
    own = np.maximum(seeds - 1, 0)
    variance = ratio(np.where(own > 0, own * between, 0.0) + weight * prior, own + weight)
    return SeedMean(mean, np.sqrt(ratio(variance, seeds)), own + weight)


def _moments(values: Floats) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
    """Return the mean, the variance and the number of the values along the last axis, without those
    that are NaN.
    """
    known = ~np.isnan(values)
    n = known.sum(axis=-1)
    mean = mean_or_nan(values, axis=-1)
    squares = np.where(known, (values - mean[..., None]) ** 2, 0.0).sum(axis=-1)
    return mean, np.where(n > 1, ratio(squares, n - 1), np.nan), n


def _prior_freedom(variances: Floats, freedom: int, independent: int) -> float:
    """Return the degrees of freedom of a prior of variances, by the method of moments.

    If all true variances are as the prior says, estimates of them scatter as chi-square divided by
    its degrees of freedom, and the prior is as good as all other means together. If they scatter
    more, so do the true ones, and the prior is worth less.

    Args:
        variances: Estimated variances as multiples of the prior.
        freedom: Degrees of freedom of each estimate.
        independent: Number of independent estimates.
    """
    limit, known = float(freedom * (independent - 1)), variances[~np.isnan(variances)]
    spread = freedom * known.var(ddof=1) / 2 if len(known) > 1 else 0.0
    scatter = float((4 * spread + freedom - 2) / (spread - 1)) if spread > 1 else np.inf
    return _PRIOR_SHARE * min(limit, scatter)


def student_quantile(freedom: npt.ArrayLike, level: float = 0.95) -> Floats:
    """Return the t with P(|T| < t) = level for Student's distribution; NaN with less than one
    degree of freedom.

    Args:
        freedom: Degrees of freedom, of any shape.
        level: Probability.

    Example:
        >>> student_quantile([1, 4, 30]).round(3).tolist()
        [12.706, 2.776, 2.042]
    """
    numbers = np.asarray(freedom, np.float64)
    distinct, which = np.unique(numbers, return_inverse=True)
    return np.array([_student_quantile(float(degrees), level) for degrees in distinct])[
        which
    ].reshape(numbers.shape)


@functools.cache
def _student_quantile(freedom: float, level: float) -> float:
    """Return the quantile for one number of degrees of freedom.

    With T = sqrt(freedom) tan(angle), the density of the angle is proportional to cos(angle) **
    (freedom - 1), which is integrated numerically. With many degrees of freedom the peak is too
    narrow for that. There, the first terms of the series in 1 / freedom are exact to 1e-8.
    """
    if not freedom >= 1:
        return math.nan
    if freedom > _MANY:
        z = NormalDist().inv_cdf((1 + level) / 2)
        return z + (z**3 + z) / (4 * freedom) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2)
    angle = np.linspace(0, math.pi / 2, 20_001)
    density = np.cos(angle) ** (freedom - 1)
    area = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
    return float(math.sqrt(freedom) * np.tan(np.interp(level, area / area[-1], angle)))


def interquartile_mean(strata: Sequence[Annotated[Floats, Shape("R")]], seed: int = 0) -> Interval:
    """Return the mean of the middle half of all runs, with a stratified bootstrap interval (Agarwal
    et al., 2021).

    The interquartile mean is less sensitive to outliers than the mean, and has less variance than
    the median. The resamples are drawn within each stratum, because differences between tasks are
    not random. The interval is between percentiles of the resamples.

    Args:
        strata: Scores of the runs of each task, shape (R,) each.
        seed: Random seed of the resamples.

    Returns:
        The mean and its interval. The interval is NaN if a stratum has a single run, and so is the
        mean if a stratum has no runs.
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
        strata,
        middle,
        n_resamples=_RESAMPLES,
        method="percentile",
        vectorized=True,
        random_state=seed,
    ).confidence_interval
    return Interval(value, float(interval.low), float(interval.high))
