"""What the personal models share: every rater is a judge of its own, and what is published is the judges' mean.

A judge's trust in the providers is T, shape (S, P, ...), and its credence in the raters as advisers C, shape
(S, S, ...): axis 0 is the judge, axis 1 whom it judges. A compromised judge counts as one of S, and no more.

A judge's own ratings are outcomes to it, those of the others opinions. What an opinion was worth shows where judge and
adviser rated one provider in the same round: credence is renewed by that first, and trust with the credence as renewed.
"""

import math
from collections.abc import Callable

from roletrust_env.arrays import Array, is_compiling, namespace, total

_BLOCK = 100_000
"""So many numbers of shape (judges, S, P, ...) are worked out at a time: about what a processor's cache holds."""

_TINY = 1e-30  # stands in for a branch at 0, and is lost in rounding everywhere else


def others(like: Array) -> Array:
    """1 where judge and adviser are two, 0 where they are one, shape (S, S, 1, ...) to go with (S, S, ...).

    Args:
        like: an array of shape (S, P, ...) that shows S, the number of axes, the dtype and the array library.
    """
    xp, s = namespace(like), like.shape[0]
    return (1 - xp.eye(s, dtype=like.dtype, device=like.device)).reshape(s, s, *[1] * (like.ndim - 2))


# --- a round ----------------------------------------------------------------------------------------


def told(ratings: Array, mask: Array) -> tuple[Array, Array]:
    """The ratings inside the mask and 0 elsewhere, and 1 inside it and 0 elsewhere, each of shape (S, P, ...)."""
    xp = namespace(ratings)
    met = xp.astype(mask, ratings.dtype)
    return xp.where(mask, ratings, met), met


def by_judges(of: Callable[[slice], Array], like: Array) -> Array:
    """What a function makes of some judges, put together for all: S^2 P numbers are never in memory at once.

    Args:
        of: from a slice of the judges to an array whose axis 0 is these judges.
        like: an array of shape (S, P, ...). A compiler, which fuses the loops itself, gets all the judges at once.
    """
    judges = like.shape[0]
    rows = judges if is_compiling(like) else max(1, _BLOCK // max(1, math.prod(like.shape)))
    parts = [of(slice(at, at + rows)) for at in range(0, judges, rows)]
    return parts[0] if len(parts) == 1 else namespace(like).concat(parts)


def compared(outcomes: Array, met: Array, worth: Callable[[Array], Array]) -> Array:
    """What a round's opinions were worth to each judge, summed over the providers that both rated, shape (S, S, ...).

    Args:
        outcomes: f, shape (S, P, ...), see `told`.
        met: 1 where i rated j, 0 elsewhere, shape (S, P, ...).
        worth: of an opinion, by its distance to the outcome, |f[i, j] - f[k, j]| in [0, 1].
    """

    def of(some: slice) -> Array:
        apart = abs(outcomes[some, None] - outcomes[None])
        return total(met[some, None] * met[None] * worth(apart), 2)

    return by_judges(of, outcomes)


def news(met: Array) -> Array:
    """Whether somebody rated the provider in the round, boolean, shape (P, ...): only then is trust in it renewed."""
    return total(met, 0) > 0


def in_common(met: Array) -> Array:
    """The number of providers that judge and adviser both rated in the round, shape (S, S, ...)."""
    return product(met, met.swapaxes(0, 1))


def weighed(credence: Array, said: Array) -> Array:
    """The sum over the advisers k of C[i, k] said[k, j], shape (S, P, ...)."""
    return product(credence, said)


def product(one: Array, other: Array) -> Array:
    """The matrix product of the first two axes, game by game: (A, B, ...) and (B, C, ...) make (A, C, ...)."""
    xp = namespace(one)
    here, there = (0, 1), (-2, -1)
    return xp.moveaxis(xp.moveaxis(one, here, there) @ xp.moveaxis(other, here, there), there, here)


def with_self(credence: Array) -> Array:
    """Credence as before, shape (S, S, ...), but of 1 in oneself: a judge's own experience is believed in full."""
    return 1 - others(credence) * (1 - credence)


def heeded(credence: Array, sums: Array, counts: Array) -> tuple[Array, Array]:
    """What each judge hears of each provider: the mean of ratings, each weighted by the credence in its rater.

    Args:
        credence: of the judges in the raters, shape (S, S, ...), at least 0.
        sums: of the ratings, by rater and provider, shape (S, P, ...).
        counts: of the ratings, likewise.

    Returns:
        The means, shape (S, P, ...), in [0, 1], and 0 where there is nothing to hear; and the weight that they have.
    """
    weight = weighed(credence, counts)
    return _share(mean(weighed(credence, sums), weight)), weight


# --- what is remembered -----------------------------------------------------------------------------


def credences(like: Array, value: float) -> Array:
    """The same credence of every judge in every adviser, shape (S, S, ...), for an array of shape (S, P, ...)."""
    s, shape = like.shape[0], like.shape[2:]
    return namespace(like).zeros((s, s, *shape), dtype=like.dtype, device=like.device) + value


def nothing_yet(like: Array, length: int) -> Array:
    """The memory of each judge of each provider before any rating: zeros of shape (length, S, P, ...)."""
    return namespace(like).zeros((length, *like.shape), dtype=like.dtype, device=like.device)


def remember(memory: Array, newest: Array, mask: Array) -> Array:
    """A memory of each judge's last ratings of each provider, the newest first, after one more round.

    Args:
        memory: shape (length, S, P, ...).
        newest: what is put in front where the mask is true, shape (S, P, ...); the oldest is forgotten there.
        mask: m, shape (S, P, ...), boolean.
    """
    xp = namespace(memory)
    return xp.where(mask, xp.concat([newest[None], memory[:-1]]), memory)


def mean(sums: Array, weights: Array) -> Array:
    """Sums over weights, and 0 where there is nothing to weigh."""
    return sums / (weights + _TINY)


def absorbed(previous: Array, weight: Array, sums: Array, count: Array) -> Array:
    """A weighted mean after it took in so many values, of weight 1 each, of this sum; itself where there are none."""
    return previous + mean(sums - count * previous, weight + count)


# --- what is published ------------------------------------------------------------------------------


def published_providers(trust: Array) -> Array:
    """The mean over the judges of their trust in each provider, shape (P, ...), of T, shape (S, P, ...)."""
    return _share(trust.sum(axis=0) / trust.shape[0])


def published_raters(credence: Array) -> Array:
    """The mean over the other judges of their credence in each rater, shape (S, ...), of C, shape (S, S, ...).

    A rater that is alone is judged by nobody, and has trust 1.
    """
    s = credence.shape[0]
    if s == 1:
        return 0 * credence[0] + 1
    return _share((others(credence) * credence).sum(axis=0) / (s - 1))


def _share(trust: Array) -> Array:
    """Kept to [0, 1], which a weighted mean may leave by its last bit."""
    return namespace(trust).clip(trust, 0.0, 1.0)
