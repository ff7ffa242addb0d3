"""A mean of ratings that are brought to the judge's own scale first."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Lam, Ridge, Share
from roletrust_env.trust.algorithms import Notes, smooth
from roletrust_env.trust.judges import by_judges, credences, in_common, product, published_providers


class Moments(NamedTuple):
    """The ratings x that an adviser, axis 1, has in common with a judge, axis 0, whose ratings are y; (S, S, ...) each.

    Attributes:
        count: of pairs (x, y) of one provider in one round.
        mean: of x; that of y is its transpose.
        spread: the sum of (x - mean x)^2.
        shared: the sum of (x - mean x)(y - mean y).
    """

    count: Array
    mean: Array
    spread: Array
    shared: Array

    @classmethod
    def of(cls, notes: Notes) -> "Moments":
        """Those of one round."""
        values: Array = notes.values
        weights: Array = notes.weights
        theirs = values.swapaxes(0, 1)
        count = in_common(weights)
        mean = product(weights, theirs) / _at_least_1(count)
        spread = product(weights, theirs * theirs) - count * mean * mean
        return cls(count, mean, spread, product(values, theirs) - count * mean * mean.swapaxes(0, 1))

    def joined(self, newer: "Moments") -> "Moments":
        """Those of two sets of pairs together, without the large sums whose difference is little (Chan et al. 1979)."""
        count = self.count + newer.count
        share = newer.count / _at_least_1(count)
        step = newer.mean - self.mean
        between = self.count * share * step
        return Moments(
            count,
            self.mean + share * step,
            self.spread + newer.spread + between * step,
            self.shared + newer.shared + between * step.swapaxes(0, 1),
        )


class RegressionAlignedState(NamedTuple):
    """What the aligned mean remembers: the moments of each pair, the trust (S, P, ...), the raters' (S, ...), all 1."""

    moments: Moments
    trust: Array
    tor: Array


@checked_dataclass
class RegressionAligned:
    """Regression-aligned mean: what raters say, put on the judge's own scale by what both said before, all alike.

    The idea, that subjective ratings are to be aligned to the seeker's scale by regression, is that of Zeynalvand et
    al. (2018); no formula of theirs was found, and this is not their model. For a judge's ratings y and an adviser's x
    of the same providers in the same rounds so far, N of them, a ridge regression of the difference,

        y - x = b + a (x - mean x),   sum of squared errors + ridge (a^2 + b^2) least,

    turns a new x into x + b + a (x - mean x), clipped to [0, 1]. With little in common x stays nearly as it is, and
    with nothing exactly. The judge hears the mean of the aligned ratings, its own among them; the rounds are then
    smoothed as usual. It has no notion of rater trust: a rater is corrected, and not distrusted.

    Attributes:
        lam: weight of the newest round in the trust of a provider, in [0.5, 1).
        initial: trust of a provider before any rating, in [0, 1].
        ridge: how strongly a and b are drawn to 0, at least 0.001: as by so many pairs without a difference (b), or
            by pairs without one whose squared distances from mean x add up to so much (a).
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    ridge: Ridge = 1.0
    rates_raters = False
    family = "personal"
    source = "after Zeynalvand et al. (2018)"
    cost = "S^2 P"

    def start(self, like: Array) -> RegressionAlignedState:
        """Initial trust for every provider. See `TrustModel.start`."""
        nothing, pairs = namespace(like).zeros_like(like), credences(like, 0.0)
        return RegressionAlignedState(
            Moments(pairs, pairs, pairs, pairs), nothing + self.initial, nothing[:, 0, ...] + 1
        )

    def update(self, state: RegressionAlignedState, ratings: Array, mask: Array) -> RegressionAlignedState:
        """One round of ratings. See `TrustModel.update`."""
        xp, notes = namespace(ratings), Notes.of(ratings, mask)
        slope, base = self._lines(state.moments)

        def summed(some: slice) -> Array:
            aligned = base[some, :, None, ...] + (1 + slope[some, :, None, ...]) * notes.values
            return (notes.weights * xp.clip(aligned, 0.0, 1.0)).sum(axis=1)

        heard = by_judges(summed, ratings) / _at_least_1(notes.received)
        trust = smooth(heard, state.trust, self.lam, notes.received)
        return RegressionAlignedState(state.moments.joined(Moments.of(notes)), trust, state.tor)

    def _lines(self, known: Moments) -> tuple[Array, Array]:
        """By judge and adviser, a and what an x of 0 becomes, shape (S, S, ...) each."""
        slope = (known.shared - known.spread) / (known.spread + self.ridge)
        shift = known.count * (known.mean.swapaxes(0, 1) - known.mean) / (known.count + self.ridge)
        return slope, shift - slope * known.mean

    def rater_trust(self, state: RegressionAlignedState) -> Array:
        """1 for every rater, shape (S, ...): the model has no notion of rater trust."""
        return state.tor

    def provider_trust(self, state: RegressionAlignedState) -> Array:
        """The mean of the judges' trust, shape (P, ...)."""
        return published_providers(state.trust)


def _at_least_1(count: Array) -> Array:
    """A count to divide by where its sum is 0 with it."""
    return namespace(count).where(count > 0, count, 1.0)
