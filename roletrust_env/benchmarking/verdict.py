"""Verdict on ranks: which models a run tells apart, and how often another run gives the same
rank.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.metrics.confidence import over_seeds, student_quantile

Floats = npt.NDArray[np.float64]

DIGITS = 9
"""Number of decimal digits in which means are compared. Smaller differences are rounding errors."""

_LEVEL = 0.95
_RESAMPLES = 4000
_NOTHING = 1e-12
"""Share of the largest variance below which a variance is a rounding error."""


class RankVerdict(NamedTuple):
    """Verdict on models in the order of their ranks.

    Attributes:
        tiers: Tier of each model, which counts from 1.
        holds: Probability of the rank of each model in another run; NaN if the noise is unknown.
    """

    tiers: list[int]
    holds: list[float]


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


def verdict(scores: Floats) -> RankVerdict:
    """Return the verdict on models.

    Args:
        scores: Scores of the models, the best one first, in the same games of the same seeds, shape
            (M, S, G).
    """
    if not len(scores):
        return RankVerdict([], [])
    pairs, number = _pairs(scores), len(scores)
    alike = _alike(pairs, tests=max(1, number * (number - 1) // 2))
    return RankVerdict(_tiers(alike), _holds(over_seeds(scores, number).mean, pairs, alike))


def told_apart(scores: Floats) -> float:
    """Return the share of the pairs of models that Student's paired test at 5% tells apart; NaN for
    a single model.

    Args:
        scores: Scores of the models in the same games of the same seeds, shape (M, S, G).
    """
    if len(scores) < 2:
        return np.nan
    alike = _alike(_pairs(scores), tests=1)
    return float(1 - alike[np.triu_indices(len(scores), 1)].mean())


def _pairs(scores: Floats) -> _Pairs:
    number = len(scores)
    above, below = np.triu_indices(number, 1)
    estimates = over_seeds(scores[above] - scores[below], number - 1)
    square = np.zeros((3, number, number))
    square[:, above, below] = estimates
    square[:, below, above] = -estimates.mean, estimates.error, estimates.freedom
    return _Pairs(*square)


def _alike(pairs: _Pairs, tests: int) -> npt.NDArray[np.bool_]:
    """Return which models are not told apart, shape (M, M).

    Two models are told apart if Student's paired test rejects that their scores are equal. By
    Bonferroni's correction for all pairs, any two models with equal scores are told apart in at
    most 5% of runs. Tiers need all of them, because the leader of a tier is the best one by the
    same games; the honestly significant differences of Tukey are one family for the same reason.

    Args:
        pairs: Differences between the models.
        tests: Number of tests that share the error of 5%.
    """
    level = 1 - (1 - _LEVEL) / tests
    limit = student_quantile(pairs.freedom, level) * pairs.error + 10.0**-DIGITS
    alike: npt.NDArray[np.bool_] = ~(
        abs(pairs.difference) > limit
    )  # also where the error is unknown
    return alike


def _tiers(alike: npt.NDArray[np.bool_]) -> list[int]:
    """Return the tier of each model.

    The best model without a tier leads the next tier, which reaches down to the last model that is
    not told apart from it.
    """
    tiers: list[int] = []
    while len(tiers) < len(alike):
        leader = len(tiers)
        last = int(np.flatnonzero(alike[leader]).max())
        tiers += [1 + max(tiers, default=0)] * (last + 1 - leader)
    return tiers


def _holds(means: Floats, pairs: _Pairs, alike: npt.NDArray[np.bool_]) -> list[float]:
    """Return the probability of each rank in another run with new games, and with new seeds if
    there are several.

    Both runs are noisy. The best models of this run owe a part of their lead to noise, so means are
    expected nearer to each other in the other run, the more so the noisier they are (empirical
    Bayes, Morris 1983). The other run adds noise of its own. How far models are apart and how noisy
    they are is known by estimates with few degrees of freedom, so both variances are drawn, too. A
    model that is told apart from all others is expected where it is, and does not count for how far
    the others are apart. Ranks depend only on differences between models. The covariance of models
    that has the variances of these differences is that of classical scaling (Torgerson 1952).

    Args:
        means: Mean scores of the models, shape (M,).
        pairs: Differences between the models.
        alike: True for two models that are not told apart, shape (M, M).
    """
    number, random = len(means), np.random.default_rng(0)
    if np.isnan(pairs.error).any():
        return [np.nan] * number
    covariance = _covariance(pairs.error**2)
    spectrum, vectors = np.linalg.eigh(covariance)
    spectrum = np.where(spectrum > _NOTHING * spectrum.max(), spectrum, 0.0)
    freedom = float(np.median(pairs.freedom[~np.eye(number, dtype=bool)])) if number > 1 else 1.0
    scale = freedom / random.chisquare(freedom, (_RESAMPLES, 1))
    noise = (
        np.sqrt(scale) * random.normal(size=(_RESAMPLES, number)) * np.sqrt(spectrum) @ vectors.T
    )
    among = np.flatnonzero(alike.sum(axis=1) > 1)
    shrinkage, centre = np.ones((_RESAMPLES, number)), 0.0
    if len(among) > 1:
        centre = float(means[among].mean())
        squares = float(((means[among] - centre) ** 2).sum())
        spread = random.chisquare(len(among) - 1, (_RESAMPLES, 1)) / (len(among) - 1)
        own = float(np.trace(_covariance(pairs.error[np.ix_(among, among)] ** 2)))
        if squares > 0:
            shrinkage[:, among] = np.maximum(0.0, 1.0 - scale * spread * own / squares)
    expected = centre + shrinkage * (means - centre)
    better = _better((expected + np.sqrt(1 + shrinkage) * noise).round(DIGITS))
    return [float(share) for share in (better == _better(means.round(DIGITS))).mean(axis=0)]


def _covariance(variances: Floats) -> Floats:
    """Return the covariance of M models about their mean, from the variances of their differences,
    (M, M) each.
    """
    centre = np.eye(len(variances)) - 1 / len(variances)
    return -centre @ variances @ centre / 2


def _better(means: Floats) -> npt.NDArray[np.int64]:
    """Return the number of better models for each model, (..., M)."""
    better: npt.NDArray[np.int64] = (means[..., None, :] > means[..., :, None]).sum(axis=-1)
    return better
