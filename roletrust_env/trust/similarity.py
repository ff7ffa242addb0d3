"""How alike two raters are: what they said, on the mean, of the providers that both have rated."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.trust.algorithms import MaskedRatings, occurred
from roletrust_env.trust.judges import by_judges, in_common


class Experience(NamedTuple):
    """What every rater has said of every provider so far.

    Attributes:
        counts: number of ratings, shape (S, P, ...).
        sums: of the ratings, shape (S, P, ...).
    """

    counts: Array
    sums: Array

    @classmethod
    def none(cls, like: Array) -> "Experience":
        """No rating yet; for `like` see `TrustModel.start`."""
        xp = namespace(like)
        return cls(xp.zeros_like(like), xp.zeros_like(like))

    def after(self, masked: MaskedRatings) -> "Experience":
        """With the ratings of one more round."""
        return Experience(self.counts + masked.weights, self.sums + masked.values)


class Likened(NamedTuple):
    """What a model remembers that weighs raters by how alike judge and rater have rated.

    Attributes:
        known: all ratings so far.
        trust: of each judge in each provider, shape (S, P, ...).
        credence: of each judge in each rater, shape (S, S, ...).
    """

    known: Experience
    trust: Array
    credence: Array


def disagreement(known: Experience) -> tuple[Array, Array]:
    """The mean over providers in common of the squared difference of two raters' mean ratings, and their number.

    The differences are taken one by one, (S, S, P, ...) for a moment, and not by a matrix product: of raters who agree
    that would leave the rounding of large sums, which a root magnifies.

    Returns:
        The mean squares, shape (S, S, ...), in [0, 1], and 0 with nothing in common; and the number of providers in
        common, likewise.
    """
    xp = namespace(known.sums)
    rated = occurred(known.counts)
    means = known.sums / xp.where(known.counts > 0, known.counts, 1.0)

    def squares(some: slice) -> Array:
        apart = rated[some, None, ...] * rated[None, ...] * (means[some, None, ...] - means[None, ...])
        return (apart * apart).sum(axis=2)

    common = in_common(rated)
    return by_judges(squares, rated) / xp.where(common > 0, common, 1.0), common
