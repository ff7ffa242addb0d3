"""What the personal models share: every rater is a judge of its own, and what is published is the judges' mean.

A judge's trust in the providers is T, shape (S, P, ...), and its credence in the raters as advisers C, shape
(S, S, ...): axis 0 is the judge, axis 1 whom it judges. A compromised judge counts as one of S, and no more.
"""

from collections.abc import Callable

import numpy as np

from roletrust_env.arrays import Array, namespace

_BLOCK = 300_000
"""Cells by judge, adviser and provider that NumPy makes at once, so that they stay in a processor's cache."""


def others(like: Array) -> Array:
    """1 where judge and adviser are two, 0 where they are one, shape (S, S, 1, ...) to go with (S, S, ...).

    Args:
        like: an array of shape (S, P, ...) that shows S, the number of axes, the dtype and the array library.
    """
    xp, s = namespace(like), like.shape[0]
    return (1 - xp.eye(s, dtype=like.dtype, device=like.device)).reshape(s, s, *[1] * (like.ndim - 2))


def no_pairs(like: Array) -> Array:
    """Zeros for each pair of judge and adviser, shape (S, S, ...); for `like` see `TrustModel.start`."""
    s = like.shape[0]
    return namespace(like).zeros((s, s, *like.shape[2:]), dtype=like.dtype, device=like.device)


def published_providers(trust: Array) -> Array:
    """The mean over the judges of their trust in each provider, shape (P, ...), of T, shape (S, P, ...)."""
    return trust.sum(axis=0) / trust.shape[0]


def published_raters(credence: Array) -> Array:
    """The mean over the other judges of their credence in each rater, shape (S, ...), of C, shape (S, S, ...).

    A rater that is alone is judged by nobody, and has trust 1.
    """
    s = credence.shape[0]
    if s == 1:
        return 0 * credence[0] + 1
    return (others(credence) * credence).sum(axis=0) / (s - 1)


def with_self(credence: Array) -> Array:
    """Credence as before, shape (S, S, ...), but of 1 in oneself: a judge's own experience is believed in full."""
    return 1 - others(credence) * (1 - credence)


def product(one: Array, other: Array) -> Array:
    """The matrix product of the first two axes, game by game: (A, B, ...) and (B, C, ...) make (A, C, ...)."""
    xp = namespace(one)
    here, there = (0, 1), (-2, -1)
    return xp.moveaxis(xp.moveaxis(one, here, there) @ xp.moveaxis(other, here, there), there, here)


def heeded(credence: Array, sums: Array, counts: Array) -> tuple[Array, Array]:
    """What each judge hears of each provider: the mean of ratings, each weighted by the credence in its rater.

    Args:
        credence: of the judges in the raters, shape (S, S, ...), at least 0.
        sums: of the ratings, by rater and provider, shape (S, P, ...).
        counts: of the ratings, likewise.

    Returns:
        The means, shape (S, P, ...), in [0, 1], and 0 where there is nothing to hear; and the weight that they have.
    """
    xp = namespace(sums)
    weight = product(credence, counts)
    mean = product(credence, sums) / xp.where(weight > 0, weight, 1.0)
    return xp.clip(mean, 0.0, 1.0), weight  # rounding may lead past 1


def judge_by_judge(seen: Callable[[slice], Array], like: Array) -> Array:
    """What is made of cells by judge, adviser and provider, on NumPy for some judges at a time.

    Args:
        seen: what is made for some judges, whose number is the first axis of the result.
        like: an array of shape (S, P, ...), as of the ratings.
    """
    s = like.shape[0]
    rows = max(1, _BLOCK // max(1, like.size)) if isinstance(like, np.ndarray) else s
    if rows >= s:
        return seen(slice(s))
    return np.concatenate([seen(slice(at, at + rows)) for at in range(0, s, rows)])
