"""Estimates of the raters' bias and noise from their ratings, which are clipped to [0, 1].

A rating is min(max(q_j + b_i + s_i n, 0), 1) with a standard normal n. This is a censored
regression (Tobin 1958, "Estimation of relationships for limited dependent variables"), fitted by
expectation maximisation (Dempster, Laird and Rubin 1977).
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.metrics.confidence import Interval

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

_Z_95 = 1.959963984540054
_QUARTILE = (
    0.31863936396437515  # quartile of |n|: attacks in a third of the rounds hardly change it
)
_FAR = 5.0  # standard deviations from the median beyond which a rating counts as an attack
# largest distance of a level beyond a bound, in standard deviations, if all ratings are at the
# bound
_SURE = 3.0
_STEPS, _TOLERANCE = 300, 1e-10
_MIN_NOISE = 1e-9  # smaller standard deviations count as no noise


class PerceptionEstimates(NamedTuple):
    """Estimates for a team of S raters and P providers, with 95% intervals.

    Attributes:
        ability: Perceived quality of each provider, (P,).
        bias: Bias of each rater, (S,).
        noise: Standard deviation of each rater's noise, (S,).
    """

    ability: list[Interval]
    bias: list[Interval]
    noise: list[Interval]


class _Fit(NamedTuple):
    """Fit to the ratings of one rater.

    Attributes:
        level: Mean of the unclipped ratings of each provider, (P,).
        noise: Standard deviation of the ratings.
        counts: Number of informative ratings of each provider, (P,).
    """

    level: Floats
    noise: float
    counts: Floats


def estimate_perception(ratings: Floats, calm: Mask) -> PerceptionEstimates:
    """Estimate how raters perceive services. Attacks in less than a third of the rounds hardly
    change the estimates.

    Args:
        ratings: Ratings, (R, S, P); NaN where there is none.
        calm: Mask of the rounds in which a provider served as usual, (R, P).
    """
    usual = np.where(calm[:, None, :], ratings, np.nan)
    fits = [_fit(usual[:, i]) for i in range(ratings.shape[1])]
    levels, counts = np.stack([fit.level for fit in fits]), np.stack([fit.counts for fit in fits])
    noise = np.array([fit.noise for fit in fits])
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.where(counts > 0, noise[:, None] / np.sqrt(counts), np.nan)
    rated = ~np.isnan(levels).all(axis=0)
    quality, quality_error = np.full((2, levels.shape[1]), np.nan)
    quality[rated] = np.clip(np.nanmedian(levels[:, rated], axis=0), 0, 1)
    known, raters = ~np.isnan(error).all(axis=0), (~np.isnan(levels)).sum(axis=0)
    # The standard error of a median of S levels is sqrt(pi / 2) times that of their mean.
    mean_error = np.sqrt(np.nanmean(error[:, known] ** 2, axis=0) / raters[known])
    quality_error[known] = math.sqrt(math.pi / 2) * mean_error
    return PerceptionEstimates(
        [_interval(q, e, 0.0, 1.0) for q, e in zip(quality, quality_error, strict=True)],
        [_bias(levels[i] - quality, error[i], quality_error) for i in range(len(fits))],
        [_noise(fit) for fit in fits],
    )


def _bias(difference: Floats, error: Floats, quality_error: Floats) -> Interval:
    rated = ~np.isnan(difference)
    if not rated.any():
        return Interval(0.0, math.nan, math.nan)
    mean_error = math.sqrt((error[rated] ** 2 + quality_error[rated] ** 2).sum()) / rated.sum()
    return _interval(difference[rated].mean(), mean_error, -1.0, 1.0)


def _noise(fit: _Fit) -> Interval:
    n = fit.counts.sum()
    return _interval(fit.noise, fit.noise / math.sqrt(2 * n) if n else math.nan, 0.0, math.inf)


def _interval(value: float, error: float, least: float, most: float) -> Interval:
    low, high = value - _Z_95 * error, value + _Z_95 * error
    return Interval(float(value), float(max(low, least)), float(min(high, most)))


def _fit(rows: Floats) -> _Fit:
    """Fit the ratings of one rater, (R, P)."""
    columns = [column[~np.isnan(column)] for column in rows.T]
    middle = np.array([np.median(column) if len(column) else np.nan for column in columns])
    deviations = np.concatenate(
        [_unclipped_deviations(column, m) for column, m in zip(columns, middle, strict=True)]
    )
    scale = float(np.quantile(deviations, 0.25)) / _QUARTILE if len(deviations) else 0.0
    near = [
        column[abs(column - m) <= _FAR * scale + _MIN_NOISE]
        for column, m in zip(columns, middle, strict=True)
    ]
    counts = np.array([((column > 0) & (column < 1)).sum() for column in near], float)
    level, noise = middle, scale
    for _ in range(_STEPS if scale > _MIN_NOISE else 0):
        before = noise
        steps = [_em_step(column, m, noise) for column, m in zip(near, level, strict=True)]
        level = np.array([m + step.step for m, step in zip(level, steps, strict=True)])
        level = np.clip(level, -_SURE * noise, 1 + _SURE * noise)
        noise = math.sqrt(sum(step.squares for step in steps) / sum(map(len, near)))
        if abs(noise - before) < _TOLERANCE:
            break
    return _Fit(
        level,
        noise,
        counts if scale > _MIN_NOISE else np.array([len(column) for column in near], float),
    )


def _unclipped_deviations(column: Floats, middle: float) -> Floats:
    """Return the distances of ratings from their median, on the side that is not clipped."""
    side = column[column < middle] if middle >= 0.5 else column[column > middle]
    return abs(side - middle)


class _EMStep(NamedTuple):
    """A step of expectation maximisation: the change of the level, and the expected squares around
    the new level.
    """

    step: float
    squares: float


def _em_step(column: Floats, level: float, noise: float) -> _EMStep:
    """Return the step for the ratings of one provider. A rating at a bound may have been any value
    beyond it.
    """
    if not len(column):
        return _EMStep(0.0, 0.0)
    inside = column[(column > 0) & (column < 1)] - level
    below, above = int((column <= 0).sum()), int((column >= 1).sum())
    (low, low_2), (high, high_2) = _tail_moments(level / noise), _tail_moments((1 - level) / noise)
    step = (inside.sum() + noise * (above * high - below * low)) / len(column)
    squares = (inside**2).sum() + noise**2 * (above * high_2 + below * low_2)
    return _EMStep(float(step), float(squares - len(column) * step**2))


def _tail_moments(bound: float) -> tuple[float, float]:
    """Return the mean of a standard normal variable beyond a bound, and the mean of its square."""
    mass = 0.5 * math.erfc(bound / math.sqrt(2))
    if mass < 1e-300:
        return bound, bound**2
    hazard = math.exp(-(bound**2) / 2) / math.sqrt(2 * math.pi) / mass
    return hazard, 1 + bound * hazard
