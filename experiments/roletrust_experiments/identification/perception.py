"""How raters see services, from what they say: a bias and a noise of each, through ratings that are clipped to [0, 1].

A rating is min(max(q_j + b_i + s_i n, 0), 1) with a standard normal n: a censored regression (Tobin 1958, "Estimation
of relationships for limited dependent variables"), fitted by expectation maximisation (Dempster, Laird and Rubin 1977).
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.metrics.confidence import Interval

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

_Z_95 = 1.959963984540054
_QUARTILE = 0.31863936396437515  # of |n|: so attacks in a third of the rounds leave it nearly as it is
_FAR = 5.0  # deviations from the median beyond which a rating is an attack's
_SURE = 3.0  # deviations that a level lies beyond the bound at most, where all ratings are at the bound
_STEPS, _SETTLED = 300, 1e-10
_LEAST = 1e-9  # deviation under which there is none


class Seen(NamedTuple):
    """What a team of S raters and P providers is like.

    Attributes:
        ability: of each provider, the quality that is seen of it, (P,).
        bias: of each rater, (S,).
        noise: the deviation of each rater, (S,).
    """

    ability: list[Interval]
    bias: list[Interval]
    noise: list[Interval]


class _Fit(NamedTuple):
    """What one rater makes of all providers: levels (P,), its deviation, and how many ratings say so in each, (P,)."""

    level: Floats
    noise: float
    counts: Floats


def perceive(ratings: Floats, calm: Mask) -> Seen:
    """How raters see services, apart from attacks in less than a third of the rounds.

    Args:
        ratings: (R, S, P), NaN where there is none.
        calm: rounds in which a provider served as it usually does, (R, P).
    """
    quiet = np.where(calm[:, None, :], ratings, np.nan)
    fits = [_fit(quiet[:, i]) for i in range(ratings.shape[1])]
    levels, counts = np.stack([fit.level for fit in fits]), np.stack([fit.counts for fit in fits])
    noise = np.array([fit.noise for fit in fits])
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.where(counts > 0, noise[:, None] / np.sqrt(counts), np.nan)
    rated = ~np.isnan(levels).all(axis=0)
    quality = np.full(levels.shape[1], np.nan)
    quality[rated] = np.clip(np.nanmedian(levels[:, rated], axis=0), 0, 1)
    raters = np.maximum((~np.isnan(levels)).sum(axis=0), 1)
    # A median of S levels is sqrt(pi / 2) times less sure than their mean.
    doubt = math.sqrt(math.pi / 2) * np.sqrt(np.nanmean(error**2, axis=0) / raters) if rated.any() else quality
    return Seen(
        [_interval(q, e, 0.0, 1.0) for q, e in zip(quality, doubt, strict=True)],
        [_bias(levels[i] - quality, error[i], doubt) for i in range(len(fits))],
        [_spread(fit) for fit in fits],
    )


def _bias(apart: Floats, error: Floats, doubt: Floats) -> Interval:
    there = ~np.isnan(apart)
    if not there.any():
        return Interval(0.0, math.nan, math.nan)
    n = there.sum()
    return _interval(apart[there].mean(), math.sqrt((error[there] ** 2 + doubt[there] ** 2).sum()) / n, -1.0, 1.0)


def _spread(fit: _Fit) -> Interval:
    n = fit.counts.sum()
    return _interval(fit.noise, fit.noise / math.sqrt(2 * n) if n else math.nan, 0.0, math.inf)


def _interval(value: float, error: float, least: float, most: float) -> Interval:
    low, high = value - _Z_95 * error, value + _Z_95 * error
    return Interval(float(value), float(max(low, least)), float(min(high, most)))


def _fit(rows: Floats) -> _Fit:
    """One rater, (R, P)."""
    columns = [column[~np.isnan(column)] for column in rows.T]
    middle = np.array([np.median(column) if len(column) else np.nan for column in columns])
    apart = np.concatenate([_inner(column, m) for column, m in zip(columns, middle, strict=True)])
    scale = float(np.quantile(apart, 0.25)) / _QUARTILE if len(apart) else 0.0
    near = [column[abs(column - m) <= _FAR * scale + _LEAST] for column, m in zip(columns, middle, strict=True)]
    counts = np.array([((column > 0) & (column < 1)).sum() for column in near], float)
    level, noise = middle, scale
    for _ in range(_STEPS if scale > _LEAST else 0):
        before = noise
        moved = [_moved(column, m, noise) for column, m in zip(near, level, strict=True)]
        level = np.array([m + one.step for m, one in zip(level, moved, strict=True)])
        level = np.clip(level, -_SURE * noise, 1 + _SURE * noise)
        noise = math.sqrt(sum(one.squares for one in moved) / sum(map(len, near)))
        if abs(noise - before) < _SETTLED:
            break
    return _Fit(level, noise, counts if scale > _LEAST else np.array([len(column) for column in near], float))


def _inner(column: Floats, middle: float) -> Floats:
    """How far ratings are from their median, on the side where they are not clipped."""
    side = column[column < middle] if middle >= 0.5 else column[column > middle]
    return abs(side - middle)


class _Moved(NamedTuple):
    """A step of expectation maximisation: of the level, and the expected squares around the new one."""

    step: float
    squares: float


def _moved(column: Floats, level: float, noise: float) -> _Moved:
    """What the ratings of a provider say; of those at a bound it is only known that they are not inside."""
    if not len(column):
        return _Moved(0.0, 0.0)
    inside = column[(column > 0) & (column < 1)] - level
    below, above = int((column <= 0).sum()), int((column >= 1).sum())
    (low, low_2), (high, high_2) = _tail(level / noise), _tail((1 - level) / noise)
    step = (inside.sum() + noise * (above * high - below * low)) / len(column)
    squares = (inside**2).sum() + noise**2 * (above * high_2 + below * low_2)
    return _Moved(float(step), float(squares - len(column) * step**2))


def _tail(bound: float) -> tuple[float, float]:
    """The mean of a standard normal beyond a bound, and that of its square."""
    mass = 0.5 * math.erfc(bound / math.sqrt(2))
    if mass < 1e-300:
        return bound, bound**2
    hazard = math.exp(-(bound**2) / 2) / math.sqrt(2 * math.pi) / mass
    return hazard, 1 + bound * hazard
