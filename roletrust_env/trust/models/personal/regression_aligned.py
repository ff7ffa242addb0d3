"""The mean of ratings that are first mapped to the judge's own scale."""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Lam, Ridge, Share, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, PerRater
from roletrust_env.trees import BALANCES, COUNTS, SHARES, ValueRange
from roletrust_env.trust.personal import (
    Personal,
    by_judges,
    credences,
    in_common,
    news,
    others,
    product,
)
from roletrust_env.trust.ratings import Ratings, smooth


class Moments(NamedTuple):
    """Moments of the ratings x of an adviser, axis 1, and the services y of a judge, axis 0, that
    are in common; each of shape (S, S, ...).

    Attributes:
        count: Number of pairs (x, y) of one provider in one round.
        mean: Mean of x.
        outcome: Mean of y.
        spread: Sum of (x - mean of x)^2.
        shared: Sum of (x - mean of x)(y - mean of y).
    """

    count: Annotated[PerAdviser, COUNTS]
    mean: Annotated[PerAdviser, SHARES]
    outcome: Annotated[PerAdviser, SHARES]
    spread: Annotated[PerAdviser, ValueRange(0, "count")]
    shared: Annotated[PerAdviser, BALANCES]

    @classmethod
    def of(cls, ratings: Ratings) -> "Moments":
        """Return the moments of one round."""
        own, theirs = ratings.experience, ratings.values.swapaxes(0, 1)
        count, apart = in_common(ratings), others(ratings.values)
        mean = apart * product(own.weights, theirs) / _at_least_1(count)
        outcome = product(own.values, ratings.weights.swapaxes(0, 1))
        outcome = apart * outcome / _at_least_1(count)
        spread = apart * product(own.weights, theirs * theirs) - count * mean * mean
        shared = apart * product(own.values, theirs) - count * mean * outcome
        return cls(count, mean, outcome, spread, shared)

    def joined(self, newer: "Moments") -> "Moments":
        """Return the moments of both sets of pairs, without differences of large sums (Chan et al.
        1979).
        """
        count = self.count + newer.count
        share = newer.count / _at_least_1(count)
        step, outcome_step = newer.mean - self.mean, newer.outcome - self.outcome
        between = self.count * share * step
        return Moments(
            count,
            self.mean + share * step,
            self.outcome + share * outcome_step,
            self.spread + newer.spread + between * step,
            self.shared + newer.shared + between * outcome_step,
        )


class RegressionAlignedState(NamedTuple):
    """Memory of the aligned mean: moments of each pair, trust (S, P, ...), trust of the raters (S,
    ...), all 1.
    """

    moments: Moments
    trust: Annotated[PerPair, SHARES]
    tor: Annotated[PerRater, SHARES]


@checked_dataclass
class RegressionAligned(Personal):
    """Regression-aligned mean: ratings mapped to the judge's own scale by a regression of common
    ratings, all alike.

    Zeynalvand et al. (2018) had the idea to align subjective ratings to the seeker's scale by
    regression. No formula of theirs was found, and this is not their model. Let y be the services
    that a judge received and x an adviser's ratings of the same providers in the same rounds so
    far, N of them. A ridge regression of the difference,

        y - x = b + a (x - mean x),   sum of squared errors + ridge (a^2 + b^2) least,

    turns a new x into x + b + a (x - mean x), clipped to [0, 1]. With few common ratings x hardly
    changes, and without any it does not change. The judge takes the mean of the aligned ratings of
    the others and of its own services; the rounds are then smoothed as usual. There is no rater
    trust: a rater is corrected, not distrusted.

    Attributes:
        lam: Weight of the newest round in the trust of a provider, in [0.5, 1).
        initial: Trust of a provider before any rating, in [0, 1].
        ridge: Strength of the pull of a and b to 0, at least 0.001. It equals this number of pairs
            without a difference (b), or pairs without one whose squared distances from mean x have
            this sum (a).
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    ridge: Ridge = 1.0
    rates_raters = False
    source = "after Zeynalvand et al. (2018)"
    cost = "S^2 P"

    def start(self, like: PerPair) -> RegressionAlignedState:
        """Return the state with initial trust in every provider. See `TrustModel.start`."""
        nothing, pairs = namespace(like).zeros_like(like), credences(like, 0.0)
        return RegressionAlignedState(
            Moments(pairs, pairs, pairs, pairs, pairs),
            nothing + self.initial,
            nothing[:, 0, ...] + 1,
        )

    def update(self, state: RegressionAlignedState, ratings: Ratings) -> RegressionAlignedState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        slope, base = self._lines(state.moments)

        strangers = others(ratings.values)

        def summed(judges: slice) -> Array:
            aligned = (
                base[judges, :, None, ...] + (1 + slope[judges, :, None, ...]) * ratings.values
            )
            weights = strangers[judges, :, None, ...] * ratings.weights
            return (weights * xp.clip(aligned, 0.0, 1.0)).sum(axis=1)

        received = news(ratings)
        sums = by_judges(summed, ratings.values) + ratings.experience.values
        trust = smooth(sums / _at_least_1(received), state.trust, self.lam, received)
        return RegressionAlignedState(state.moments.joined(Moments.of(ratings)), trust, state.tor)

    def _lines(self, known: Moments) -> tuple[Array, Array]:
        """Return, by judge and adviser, a and the image of x = 0, each of shape (S, S, ...)."""
        slope = (known.shared - known.spread) / (known.spread + self.ridge)
        shift = known.count * (known.outcome - known.mean) / (known.count + self.ridge)
        return slope, shift - slope * known.mean

    def rater_trust(self, state: RegressionAlignedState) -> PerRater:
        """Return 1 for every rater, shape (S, ...), since the model has no notion of rater
        trust.
        """
        return state.tor


def _at_least_1(count: Array) -> Array:
    """Return the count, or 1 where it is 0, as a divisor."""
    return namespace(count).where(count > 0, count, 1.0)
