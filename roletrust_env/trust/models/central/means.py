"""Means of each provider's ratings, smoothed over the rounds: plain, weighted by agreement, robust;
and the control.
"""

from abc import ABC, abstractmethod

from roletrust_env.arrays import namespace
from roletrust_env.parameters import Lam, LessThanHalf, PositiveAmount, Share, checked_dataclass
from roletrust_env.shapes import PerPair, PerProvider
from roletrust_env.trust.algorithms import Trusts
from roletrust_env.trust.ratings import (
    PROVIDER,
    RATER,
    Published,
    Ratings,
    mean,
    smooth,
    weighted_mean,
)


@checked_dataclass
class Smoothed(Published):
    """Base of trust models that remember nothing but trust: initial state and read-outs.

    Attributes:
        lam: Weight of the newest round, in [0.5, 1).
        initial: Trust before any rating, in [0, 1].
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    rates_raters = True
    local = True

    def start(self, like: PerPair) -> Trusts:
        """Return the initial trust of all agents. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return Trusts(nothing[:, 0, ...] + self.initial, nothing[0] + self.initial)


@checked_dataclass
class Constant(Published):
    """Control: all agents keep the initial trust, so no attack does harm and no choice by trust is
    informed.

    Attributes:
        initial: Trust of all agents, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = True
    differentiable = False  # it has no gradient at all
    cost = "S + P"
    local = True

    def start(self, like: PerPair) -> Trusts:
        """Return the initial trust of all agents. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return Trusts(nothing[:, 0, ...] + self.initial, nothing[0] + self.initial)

    def update(self, state: Trusts, ratings: Ratings) -> Trusts:
        """Return the state unchanged. See `TrustModel.update`."""
        return state


@checked_dataclass
class Mean(Smoothed):
    """Undefended baseline: exponential mean of a provider's average rating, in which all raters
    count alike.
    """

    rates_raters = False

    def start(self, like: PerPair) -> Trusts:
        """Return the initial trust of the providers, and 1 for every rater. See
        `TrustModel.start`.
        """
        nobody, top = super().start(like)
        return Trusts(0 * nobody + 1, top)

    def update(self, state: Trusts, ratings: Ratings) -> Trusts:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        average = mean(ratings, ratings.values, PROVIDER)
        return Trusts(state.tor, smooth(average, state.top, self.lam, ratings.count(PROVIDER)))


@checked_dataclass
class DeviationWeighted(Smoothed):
    """Deviation-weighted mean: the less a rater has deviated from the average rating, the more it
    counts.

        fbar[j] = mean over the raters i of j of f[i, j]
        R[i]   <- lam (1 - mean over the providers j that i rated of |f[i, j] - fbar[j]|) + (1 -
                lam) R[i]
        T[j]   <- lam (sum over the raters i of j of R[i] f[i, j] / sum of R[i]) + (1 - lam) T[j],
                R as just updated

    The literature has many models of this kind, such as that of Liu et al. (2011). This one claims
    to match none of them, and is named for what it does.
    """

    def update(self, state: Trusts, ratings: Ratings) -> Trusts:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        average = mean(ratings, ratings.values, PROVIDER)
        distance = mean(ratings, abs(ratings.values - ratings.gather(average, PROVIDER)), RATER)
        tor = smooth(1 - distance, state.tor, self.lam, ratings.count(RATER))
        # A rating is nearer than 1 to an average that includes it, so weights are above 0.
        quality = weighted_mean(
            ratings, ratings.values, ratings.weigh(ratings.gather(tor, RATER)), PROVIDER
        )
        return Trusts(tor, smooth(quality, state.top, self.lam, ratings.count(PROVIDER)))


def middle_mean(ratings: Ratings, cut: PerProvider | float) -> PerProvider:
    """Return the mean of each provider's n ratings after cutting some of the lowest and as many of
    the highest.

    A rating may be cut in part and then counts with the rest of its weight. With (n - 1) / 2 cut
    per side, the mean is the median.

    Args:
        ratings: Ratings of the round.
        cut: Number of ratings to cut per side, shape (P, ...) or one number, less than n / 2 where
            n > 0.

    Returns:
        Shape (P, ...); 0 where there are no ratings.
    """
    xp, count = namespace(ratings.values), ratings.count(PROVIDER)
    pairs, values, place = ratings.sorted_by_provider()
    above, below = (pairs.gather(edge, PROVIDER) - place for edge in (count - cut, cut))
    weights = xp.clip(above, 0, 1) - xp.clip(below, 0, 1)
    return weighted_mean(
        pairs, xp.where(place < pairs.gather(count, PROVIDER), values, 0.0), weights, PROVIDER
    )


def median(ratings: Ratings) -> PerProvider:
    """Return the median of each provider's ratings, shape (P, ...); of an even number, the mean of
    the middle two.
    """
    return middle_mean(ratings, (ratings.count(PROVIDER) - 1) / 2)


@checked_dataclass
class ByCentre(Smoothed, ABC):
    """Base of trust models that are defined by a centre of each provider's ratings. Both trusts
    follow from it.

    centre[j] = the model's own, of f[i, j] over the raters i of j
    T[j]     <- lam centre[j] + (1 - lam) T[j]
    R[i]     <- lam (1 - mean over the providers j that i rated of |f[i, j] - centre[j]|)
                + (1 - lam) R[i]
    """

    @abstractmethod
    def centre(self, ratings: Ratings) -> PerProvider:
        """Return the centre of each provider's ratings, shape (P, ...), in [0, 1] also for an
        unrated provider.
        """

    def update(self, state: Trusts, ratings: Ratings) -> Trusts:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        centre = self.centre(ratings)
        distance = mean(ratings, abs(ratings.values - ratings.gather(centre, PROVIDER)), RATER)
        tor = smooth(1 - distance, state.tor, self.lam, ratings.count(RATER))
        return Trusts(tor, smooth(centre, state.top, self.lam, ratings.count(PROVIDER)))


@checked_dataclass
class Median(ByCentre):
    """Median of a provider's ratings: robust as long as fewer than half of the raters lie.

    Smoothing and the trust of raters are those of `ByCentre`.
    """

    source = "Huber (1981)"
    differentiable = (
        False  # the middle rating changes from one rater to another, and the others have no slope
    )
    cost = "S log S P"

    def centre(self, ratings: Ratings) -> PerProvider:
        """Return the median of each provider's ratings. See `ByCentre.centre`."""
        return median(ratings)


@checked_dataclass
class TrimmedMean(ByCentre):
    """Trimmed mean: a share of the lowest ratings of a provider and as many of the highest do not
    count.

    Exactly `share` n of n ratings are cut per side, so a rating at the edge may count in part.
    Rounded down to a whole number, a quarter of three raters would be none. The model is robust up
    to a share of liars of `share`. Smoothing and the trust of raters are those of `ByCentre`.

    Attributes:
        share: Share of the ratings that is cut per side, in [0, 0.5).
    """

    share: LessThanHalf = 0.25
    source = "Tukey and McLaughlin (1963)"
    differentiable = False  # a rating that is cut has no slope
    cost = "S log S P"

    def centre(self, ratings: Ratings) -> PerProvider:
        """Return the trimmed mean of each provider's ratings. See `ByCentre.centre`."""
        return middle_mean(ratings, self.share * ratings.count(PROVIDER))


STEPS = 30
"""Number of reweighting steps.

Of up to 15 ratings drawn at random, the centre is then within 5e-5 of its fixed point. It is
further away where few ratings lie between two large camps: up to 6e-2 was seen with 100 raters.
"""


@checked_dataclass
class HuberMean(ByCentre):
    """Huber mean: ratings near a provider's centre count in full, and others less the further away
    they are.

    Huber (1964), with a fixed width in place of an estimated scale, since ratings have one already:

        centre = sum over raters i of w[i] f[i] / sum of w[i],
                w[i] = min(1, width / |f[i] - centre|)

    The centre is computed by 30 such steps from the median, see `STEPS` for how near they come.
    Smoothing and the trust of raters are those of `ByCentre`.

    Attributes:
        width: Distance from the centre up to which a rating counts in full, above 0; from 1 on,
            this is the mean.
    """

    width: PositiveAmount = 0.1
    source = "Huber (1964)"
    cost = "S log S P"

    def centre(self, ratings: Ratings) -> PerProvider:
        """Return the Huber mean of each provider's ratings. See `ByCentre.centre`."""
        centre = median(ratings)
        for _ in range(STEPS):
            distance = abs(ratings.values - ratings.gather(centre, PROVIDER))
            weights = ratings.weigh(self.width / distance.clip(self.width, None))
            centre = weighted_mean(ratings, ratings.values, weights, PROVIDER)
        return centre
