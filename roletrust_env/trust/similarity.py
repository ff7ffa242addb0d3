"""Similarity of two raters: their mean ratings of the providers that both have rated."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.trust.judges import by_judges, in_common
from roletrust_env.trust.ratings import Ratings, occurred


class Experience(NamedTuple):
    """All ratings so far, by rater and provider.

    Attributes:
        counts: Number of ratings, shape (S, P, ...).
        sums: Sum of the ratings, shape (S, P, ...).
    """

    counts: Array
    sums: Array

    @classmethod
    def none(cls, like: Array) -> "Experience":
        """Return the experience before any rating; for `like` see `TrustModel.start`."""
        xp = namespace(like)
        return cls(xp.zeros_like(like), xp.zeros_like(like))

    def after(self, ratings: Ratings) -> "Experience":
        """Return the experience after one more round."""
        return Experience(self.counts + ratings.weights, self.sums + ratings.values)


class Likened(NamedTuple):
    """Memory of a model that weights raters by their similarity to the judge.

    Attributes:
        known: All ratings so far.
        trust: Trust of each judge in each provider, shape (S, P, ...).
        credence: Credence of each judge in each rater, shape (S, S, ...).
    """

    known: Experience
    trust: Array
    credence: Array


def disagreement(known: Experience) -> tuple[Array, Array]:
    """Return the mean squared difference of two raters' mean ratings over common providers, and their number.

    The differences are taken one by one, in temporary arrays of shape (S, S, P, ...). A matrix product would leave the
    rounding error of large sums for raters who agree, which a root magnifies.

    Returns:
        The mean squares, shape (S, S, ...), in [0, 1], and 0 without common providers; and the number of common
        providers, of the same shape.
    """
    xp = namespace(known.sums)
    rated = occurred(known.counts)
    means = known.sums / xp.where(known.counts > 0, known.counts, 1.0)

    def squares(some: slice) -> Array:
        apart = rated[some, None, ...] * rated[None, ...] * (means[some, None, ...] - means[None, ...])
        return (apart * apart).sum(axis=2)

    common = in_common(rated)
    return by_judges(squares, rated) / xp.where(common > 0, common, 1.0), common
