"""How well the trust of providers tells good ones from bad ones."""

from typing import Literal

import numpy as np

from roletrust_env.metrics.score import Flags, Floats, Score, mean_or_nan, ratio


def kendall_tau(trust: Floats, quality: Floats, ties: Literal["a", "b"] = "b") -> Score:
    """Rank correlation of Kendall (1938): pairs in the right order less pairs in the wrong one, over all pairs.

        tau_a = (C - D) / (K (K - 1) / 2)
        tau_b = (C - D) / sqrt(pairs not tied in trust * pairs not tied in quality)

    Args:
        trust: of the providers, (P, ...), NaN where one has none.
        quality: their true quality, (P, ...), such as the best each offered, `np.nanmax(history.offered, axis=0)`.
        ties: `"a"` counts tied pairs as neither right nor wrong; `"b"` leaves them out (Kendall 1945).

    Raises:
        ValueError: `ties` is something else.
    """
    if ties not in ("a", "b"):
        raise ValueError(f"ties is {ties!r}; it must be 'a' or 'b'")
    in_trust, in_quality = _pairs(trust, quality)
    known = ~np.isnan(in_trust)
    agreeing = np.where(known, np.sign(in_trust) * np.sign(in_quality), 0.0).sum(axis=0)
    if ties == "a":
        whole = known.sum(axis=0).astype(np.float64)
    else:
        whole = np.sqrt((known & (in_trust != 0)).sum(axis=0) * 1.0 * (known & (in_quality != 0)).sum(axis=0))
    return Score.where(whole > 0, ratio(agreeing, whole), "there are no two providers to be told apart")


def spearman(trust: Floats, quality: Floats) -> Score:
    """Rank correlation of Spearman (1904): Pearson's of the ranks, tied ones sharing their mean rank.

        rho = cov(rank of trust, rank of quality) / (std(rank of trust) std(rank of quality))

    Args:
        trust: of the providers, (P, ...), NaN where one has none.
        quality: their true quality, (P, ...), as for `kendall_tau`.
    """
    known = ~np.isnan(trust) & ~np.isnan(quality)
    x, y = (_centred(_ranks(np.where(known, values, np.nan))) for values in (trust, quality))
    spread = np.sqrt((x * x).sum(axis=0) * (y * y).sum(axis=0))
    return Score.where(spread > 0, ratio((x * y).sum(axis=0), spread), "there are no two providers to be told apart")


def absolute_error(trust: Floats, quality: Floats) -> Score:
    """How far trust is from quality.

        error = mean over providers j of |trust[j] - quality[j]|

    Args:
        trust: of the providers, (P, ...), NaN where one has none.
        quality: their true quality, (P, ...), as for `kendall_tau`.
    """
    error = mean_or_nan(abs(trust - quality), axis=0)
    return Score.where(~np.isnan(error), error, "no provider has a trust")


def coverage(rated: Flags) -> Score:
    """The share of providers of whom there is any rating, so that their trust is more than a beginning.

        coverage = providers j with a rating[t, i, j] in any round t by any rater i / providers

    Args:
        rated: where ratings arrived, (T, S, P, ...), boolean.
    """
    return Score(np.asarray(rated.any(axis=(0, 1)).mean(axis=0)))


def _pairs(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """All differences within a and within b of two that both are known in, (K (K - 1) / 2, ...) each; else NaN."""
    i, j = np.triu_indices(len(a), 1)
    difference, other = a[i] - a[j], b[i] - b[j]
    unknown = np.isnan(difference) | np.isnan(other)
    return np.where(unknown, np.nan, difference), np.where(unknown, np.nan, other)


def _ranks(values: Floats) -> Floats:
    """The rank of each along the first axis, from 0, tied ones sharing their mean; NaN stays NaN."""
    known = ~np.isnan(values)
    below = (values[:, None] > values[None]).sum(axis=1)
    tied = (values[:, None] == values[None]).sum(axis=1)
    return np.where(known, below + (tied - 1) / 2, np.nan)


def _centred(values: Floats) -> Floats:
    """The values less their mean, 0 where unknown."""
    return np.where(np.isnan(values), 0.0, values - mean_or_nan(values, axis=0))
