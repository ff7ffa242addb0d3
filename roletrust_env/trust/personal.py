"""The common part of personal models: every rater is a judge, and the published trust is the mean
of the judges.

The trust T of the judges in the providers has shape (S, P, ...). Their credence C in the raters as
advisers has shape (S, S, ...). Axis 0 is the judge, axis 1 the judged agent. A compromised judge
counts as one of S, and no more.

For a judge, its own ratings are outcomes and the ratings of others are opinions. Where judge and
adviser rate a provider in the same round, the outcome shows how good the opinion was. Credence is
updated first, then trust with the new credence.
"""

import math
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np

from roletrust_env.arrays import Array, device_of, is_compiling, namespace, total
from roletrust_env.shapes import PerAdviser, PerPair, PerProvider, PerRater, Shape
from roletrust_env.trust.ratings import Ratings


class Personal:
    """A personal model: its state has the trust T of each judge in each provider as `trust`, shape
    (S, P, ...).

    A state with the credence C of each judge in each rater, shape (S, S, ...), has it as
    `credence`.
    """

    family = "personal"

    def judge_trust(self, state: Any) -> PerPair:
        """Return the trust of each judge in each provider, shape (S, P, ...)."""
        trust: Array = state.trust
        return trust

    def rater_trust(self, state: Any) -> PerRater:
        """Return the other judges' mean credence in each rater, shape (S, ...)."""
        return published_raters(state.credence)

    def provider_trust(self, state: Any) -> PerProvider:
        """Return the judges' mean trust in each provider, shape (P, ...)."""
        return published_providers(state.trust)


_BLOCK = 100_000
"""Number of values of shape (judges, S, P, ...) computed at a time: about the size of a processor's
cache."""

_TINY = 1e-30  # replaces a branch at 0; elsewhere it is lost in rounding


def others(like: PerPair) -> Array:
    """Return 1 where judge and adviser differ, 0 elsewhere, shape (S, S, 1, ...) to broadcast with
    (S, S, ...).

    Args:
        like: Array of shape (S, P, ...) that shows S, the number of axes, the dtype and the array
            library.
    """
    xp, s = namespace(like), like.shape[0]
    return (1 - xp.eye(s, dtype=like.dtype, device=device_of(like))).reshape(
        s, s, *[1] * (like.ndim - 2)
    )


# --- a round
# ----------------------------------------------------------------------------------------


def by_judges(of: Callable[[slice], Array], like: PerPair) -> Array:
    """Return a function's results for all judges, computed in blocks, so S^2 P values are never in
    memory at once.

    Args:
        of: Function of a slice of the judges that returns an array whose axis 0 is these judges.
        like: Array of shape (S, P, ...). A compiler gets all judges at once, since it fuses the
            loops itself.
    """
    many = like.shape[0]
    rows = many if is_compiling(like) else max(1, _BLOCK // max(1, math.prod(like.shape)))
    parts = [of(slice(at, at + rows)) for at in range(0, many, rows)]
    return parts[0] if len(parts) == 1 else namespace(like).concat(parts)


def by_pairs(of: Callable[[slice, slice], Array], like: PerPair) -> Array:
    """Return a function's results for all pairs of a judge and an adviser; see `by_judges`. NumPy
    takes each pair once.

    Args:
        of: Symmetric function of a slice of judges and one of advisers, whose axes 0 and 1 are
            these.
        like: Array of shape (S, P, ...).
    """
    many, rows = like.shape[0], max(1, _BLOCK // max(1, math.prod(like.shape)))
    if rows >= many or not isinstance(like, np.ndarray):
        return by_judges(lambda judges: of(judges, slice(None)), like)
    values = np.empty((many, many, *like.shape[2:]), like.dtype)
    for at in range(0, many, rows):
        block, rest = slice(at, at + rows), slice(at, None)
        values[block, rest] = part = of(block, rest)
        values[rest, block] = part.swapaxes(0, 1)
    return values


def compare_opinions(ratings: Ratings, worth: Callable[[Array], Array]) -> PerAdviser:
    """Return the value of a round's opinions to each judge, summed over common providers, shape (S,
    S, ...).

    Args:
        ratings: Ratings f of the round, on a grid.
        worth: Function from an opinion's distance to the outcome to its value: |f[i, j] - f[k, j]|
            in [0, 1].
    """
    said, met = ratings.values, ratings.weights

    def of(judges: slice, advisers: slice) -> Array:
        value = worth(abs(said[judges, None] - said[None, advisers]))
        return total(value if ratings.full else met[judges, None] * met[None, advisers] * value, 2)

    return by_pairs(of, said)


def in_common(ratings: Ratings) -> PerAdviser:
    """Return the number of providers that judge and adviser both rated in the round, shape (S, S,
    ...).
    """
    met = ratings.weights
    if ratings.full and isinstance(met, np.ndarray):
        return credences(met, ratings.shape[1])
    return product(met, met.swapaxes(0, 1))


def credence_sum(credence: PerAdviser, said: PerPair) -> PerPair:
    """Return the sum over the advisers k of C[i, k] said[k, j], shape (S, P, ...)."""
    return product(credence, said)


def product(first: Array, second: Array) -> Array:
    """Return the matrix product over the first two axes, game by game: (A, B, ...) and (B, C, ...)
    make (A, C, ...).
    """
    xp = namespace(first)
    here, last_axes = (0, 1), (-2, -1)
    return xp.moveaxis(
        xp.moveaxis(first, here, last_axes) @ xp.moveaxis(second, here, last_axes), last_axes, here
    )


def with_self(credence: PerAdviser) -> PerAdviser:
    """Return the credence with 1 for each judge in itself, shape (S, S, ...): own experience counts
    in full.
    """
    return 1 - others(credence) * (1 - credence)


def weighted_advice(
    credence: PerAdviser, sums: PerPair, counts: PerPair
) -> tuple[PerPair, PerPair]:
    """Return the mean rating of each provider for each judge, weighted by the credence in the
    raters.

    Args:
        credence: Credence of the judges in the raters, shape (S, S, ...), at least 0.
        sums: Sums of ratings, by rater and provider, shape (S, P, ...).
        counts: Numbers of ratings, of the same shape.

    Returns:
        The means, shape (S, P, ...), in [0, 1], and 0 where there are no ratings; and their total
        weights.
    """
    weight = credence_sum(credence, counts)
    return _in_range(mean_of_sums(credence_sum(credence, sums), weight)), weight


# --- what is remembered
# -----------------------------------------------------------------------------


def credences(like: PerPair, value: float) -> PerAdviser:
    """Return equal credence of all judges in all advisers, shape (S, S, ...), for an array of shape
    (S, P, ...).
    """
    s, shape = like.shape[0], like.shape[2:]
    return namespace(like).zeros((s, s, *shape), dtype=like.dtype, device=device_of(like)) + value


def nothing_yet(like: PerPair, length: int) -> Annotated[Array, Shape("length S P ...")]:
    """Return the memory of each judge of each provider before any rating: zeros of shape (length,
    S, P, ...).
    """
    return namespace(like).zeros((length, *like.shape), dtype=like.dtype, device=device_of(like))


def push(
    memory: Annotated[Array, Shape("length S P ...")], newest: PerPair, ratings: Ratings
) -> Annotated[Array, Shape("length S P ...")]:
    """Return the memory of each judge's last ratings of each provider, the newest first, after one
    more round.

    Args:
        memory: Memory before the round, shape (length, S, P, ...).
        newest: Values to put in front for pairs with a rating, shape (S, P, ...); the oldest value
            is dropped there.
        ratings: Ratings of the round, on a grid.
    """
    return ratings.write(memory, namespace(memory).concat([newest[None], memory[:-1]]))


def mean_of_sums(sums: Array, weights: Array) -> Array:
    """Return sums over weights, and 0 where the weight is 0."""
    return sums / (weights + _TINY)


def absorb(previous: Array, weight: Array, sums: Array, count: Array) -> Array:
    """Return a weighted mean after adding `count` values of weight 1 with this sum; unchanged where
    there are none.
    """
    return previous + mean_of_sums(sums - count * previous, weight + count)


# --- what is published
# ------------------------------------------------------------------------------


def published_providers(trust: PerPair) -> PerProvider:
    """Return the judges' mean trust in each provider, shape (P, ...), from T, shape (S, P, ...)."""
    return _in_range(trust.sum(axis=0) / trust.shape[0])


def published_raters(credence: PerAdviser) -> PerRater:
    """Return the other judges' mean credence in each rater, shape (S, ...), from C, shape (S, S,
    ...).

    A single rater has no judges, and has trust 1.
    """
    s = credence.shape[0]
    if s == 1:
        return 0 * credence[0] + 1
    return _in_range((others(credence) * credence).sum(axis=0) / (s - 1))


def _in_range(trust: Array) -> Array:
    """Return trust clipped to [0, 1], which a weighted mean may leave by rounding."""
    return namespace(trust).clip(trust, 0.0, 1.0)
