"""Metrics of rankings: agreement between the trust of providers and their quality."""

from typing import Literal

import numpy as np

from roletrust_env.metrics.score import (
    FlagsByRound,
    Floats,
    ProviderFloats,
    Score,
    mean_or_nan,
    ratio,
)


def kendall_tau(
    trust: ProviderFloats, quality: ProviderFloats, ties: Literal["a", "b"] = "b"
) -> Score:
    """Return the rank correlation of Kendall (1938), from C concordant and D discordant pairs of K
    providers.

        tau_a = (C - D) / (K (K - 1) / 2)
        tau_b = (C - D) / sqrt(pairs not tied in trust * pairs not tied in quality)

    Args:
        trust: Trust of the providers, shape (P, ...), NaN where undefined.
        quality: True quality of the providers, shape (P, ...), for example the best quality that
            each of them offered, `np.nanmax(history.offered, axis=0)`.
        ties: Treatment of tied pairs: `"a"` counts them in the denominator, `"b"` leaves them out
            (Kendall 1945).

    Raises:
        ValueError: `ties` is neither `"a"` nor `"b"`.
    """
    if ties not in ("a", "b"):
        raise ValueError(f"ties is {ties!r}; it must be 'a' or 'b'")
    in_trust, in_quality = _pairs(trust, quality)
    known = ~np.isnan(in_trust)
    agreeing = np.where(known, np.sign(in_trust) * np.sign(in_quality), 0.0).sum(axis=0)
    if ties == "a":
        pairs = known.sum(axis=0).astype(np.float64)
    else:
        pairs = np.sqrt(
            (known & (in_trust != 0)).sum(axis=0) * 1.0 * (known & (in_quality != 0)).sum(axis=0)
        )
    return Score.where(pairs > 0, ratio(agreeing, pairs), "there are no two providers that differ")


def spearman(trust: ProviderFloats, quality: ProviderFloats) -> Score:
    """Return the rank correlation of Spearman (1904). Ties have their mean rank.

        rho = cov(rank of trust, rank of quality) / (std(rank of trust) std(rank of quality))

    Args:
        trust: Trust of the providers, shape (P, ...), NaN where undefined.
        quality: True quality of the providers, shape (P, ...), see `kendall_tau`.
    """
    known = ~np.isnan(trust) & ~np.isnan(quality)
    x, y = (_centred(_ranks(np.where(known, values, np.nan))) for values in (trust, quality))
    spread = np.sqrt((x * x).sum(axis=0) * (y * y).sum(axis=0))
    return Score.where(
        spread > 0, ratio((x * y).sum(axis=0), spread), "there are no two providers that differ"
    )


def absolute_error(trust: ProviderFloats, quality: ProviderFloats) -> Score:
    """Return the mean absolute difference between trust and quality.

        error = mean over providers j of |trust[j] - quality[j]|

    Args:
        trust: Trust of the providers, shape (P, ...), NaN where undefined.
        quality: True quality of the providers, shape (P, ...), see `kendall_tau`.
    """
    error = mean_or_nan(abs(trust - quality), axis=0)
    return Score.where(~np.isnan(error), error, "no provider has a trust")


def coverage(rated: FlagsByRound) -> Score:
    """Return the share of providers with at least one rating. The others still have their initial
    trust.

        coverage = providers j with a rating[t, i, j] in any round t by any rater i / providers

    Args:
        rated: Boolean array of shape (T, S, P, ...), true where a rating arrived.
    """
    return Score(np.asarray(rated.any(axis=(0, 1)).mean(axis=0)))


def _pairs(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Return the differences of all pairs in two arrays, shape (K (K - 1) / 2, ...) each; NaN if
    one is undefined.
    """
    i, j = np.triu_indices(len(a), 1)
    difference, other = a[i] - a[j], b[i] - b[j]
    unknown = np.isnan(difference) | np.isnan(other)
    return np.where(unknown, np.nan, difference), np.where(unknown, np.nan, other)


def _ranks(values: Floats) -> Floats:
    """Return the ranks along the first axis, from 1/2 on. Ties have their mean rank, and NaN stays
    NaN.
    """
    known = ~np.isnan(values)
    below = (values[:, None] > values[None]).sum(axis=1)
    tied = (values[:, None] == values[None]).sum(axis=1)
    return np.where(known, below + tied / 2, np.nan)


def _centred(values: Floats) -> Floats:
    """Return the values minus their mean along the first axis; 0 where a value is NaN."""
    return np.where(np.isnan(values), 0.0, values - mean_or_nan(values, axis=0))
