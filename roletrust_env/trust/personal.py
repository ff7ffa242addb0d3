"""The common part of personal models: every rater is a judge, and the published trust is the mean
of the judges.

The trust T of the judges in the providers has shape (S, P, ...). Their credence C in the raters as
advisers has shape (S, S, ...). Axis 0 is the judge, axis 1 the judged agent. A compromised judge
counts as one of S, and no more.

For a judge, the services that it received are outcomes: it remembers them whether its ratings of
them arrived or not. The delivered ratings of others are opinions, and nothing else of theirs
reaches it. Where a judge has an outcome and an adviser an opinion of a provider in the same round,
the outcome shows how good the opinion was. Credence is updated first, then trust with the new
credence.
"""

import math
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from roletrust_env.arrays import Array, device_of, is_compiling, namespace, total
from roletrust_env.shapes import PerAdviser, PerPair, PerProvider, PerRater, Shape
from roletrust_env.trees import AMOUNTS, ValueRange
from roletrust_env.trust.ratings import PROVIDER, Ratings


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


def compare_opinions(ratings: Ratings, worth: Callable[[Array], Array]) -> PerAdviser:
    """Return the value of a round's opinions to each judge, summed over common providers, shape (S,
    S, ...); 0 for a judge and itself.

    Args:
        ratings: Ratings f of the round, on a grid, with the experience x of the judges.
        worth: Function from an opinion's distance to the outcome to its value: |x[i, j] - f[k, j]|
            in [0, 1].
    """
    own, said, met = ratings.experience, ratings.values, ratings.weights

    def of(judges: slice) -> Array:
        value = worth(abs(own.values[judges, None] - said[None]))
        full = ratings.full and own.full
        return total(value if full else own.weights[judges, None] * met[None] * value, 2)

    return others(said) * by_judges(of, said)


def in_common(ratings: Ratings) -> PerAdviser:
    """Return the number of providers that a judge met and an adviser rated in the round, shape (S,
    S, ...); 0 for a judge and itself.
    """
    return others(ratings.values) * product(
        ratings.experience.weights, ratings.weights.swapaxes(0, 1)
    )


def news(ratings: Ratings) -> PerPair:
    """Return what a judge learns of each provider in the round: the number of ratings by others,
    and 1 more for a service of its own, shape (S, P, ...).
    """
    met = ratings.weights
    return ratings.reduce(met, PROVIDER) - met + ratings.experience.weights


def heard(credence: PerAdviser | float, said: PerPair) -> PerPair:
    """Return the sum over the advisers k other than i of C[i, k] said[k, j], shape (S, P, ...)."""
    return product(others(said) * credence, said)


def product(first: Array, second: Array) -> Array:
    """Return the matrix product over the first two axes, game by game: (A, B, ...) and (B, C, ...)
    make (A, C, ...).
    """
    xp = namespace(first)
    here, last_axes = (0, 1), (-2, -1)
    return xp.moveaxis(
        xp.moveaxis(first, here, last_axes) @ xp.moveaxis(second, here, last_axes), last_axes, here
    )


def weighted_advice(
    credence: PerAdviser, said: "Evidence", own: "Evidence"
) -> tuple[PerPair, PerPair]:
    """Return the mean rating of each provider for each judge, weighted by the credence in the
    raters; its own experience counts in full.

    Args:
        credence: Credence of the judges in the raters, shape (S, S, ...), at least 0.
        said: Ratings that were delivered.
        own: Experience of the judges.

    Returns:
        The means, shape (S, P, ...), in [0, 1], and 0 where there are no ratings; and their total
        weights.
    """
    weight = heard(credence, said.counts) + own.counts
    return _in_range(mean_of_sums(heard(credence, said.sums) + own.sums, weight)), weight


def unknown_first(known: PerPair, trust: PerPair, noise: PerPair, first: float = 1.0) -> PerPair:
    """Return a preference for unknown providers, at random, and then for the most trusted one,
    shape (S, P, ...).

    Args:
        known: Weight of what a judge knows of a provider, shape (S, P, ...); 0 if it is unknown.
        trust: Preference for the known providers, at most `first`, shape (S, P, ...).
        noise: Uniform noise in [0, 1), shape (S, P, ...).
        first: Least preference for an unknown provider.
    """
    return namespace(noise).where(known > 0, trust, first + noise)


# --- what is remembered
# -----------------------------------------------------------------------------


class Evidence(NamedTuple):
    """Sums over ratings, or over services, by rater and provider.

    Attributes:
        counts: Number of ratings, which may be weighted, shape (S, P, ...).
        sums: Sum of the ratings, weighted alike, shape (S, P, ...).
    """

    counts: Annotated[PerPair, AMOUNTS]
    sums: Annotated[PerPair, ValueRange(0, "counts")]

    @classmethod
    def none(cls, like: PerPair) -> "Evidence":
        """Return the evidence before any rating; for `like` see `TrustModel.start`."""
        xp = namespace(like)
        return cls(xp.zeros_like(like), xp.zeros_like(like))

    @classmethod
    def of(cls, ratings: Ratings) -> "Evidence":
        """Return the evidence of one round."""
        return cls(ratings.weights, ratings.values)

    def after(self, ratings: Ratings) -> "Evidence":
        """Return the evidence after one more round."""
        return Evidence(self.counts + ratings.weights, self.sums + ratings.values)

    @property
    def means(self) -> PerPair:
        """The mean rating of each pair, shape (S, P, ...); 0 without any."""
        return mean_of_sums(self.sums, self.counts)


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
