"""Iterative filtering: providers are judged by their raters, and raters by the result, until both
agree.
"""

from typing import Annotated, Literal, NamedTuple

import numpy as np

from roletrust_env.arrays import Array, largest, namespace, smallest
from roletrust_env.parameters import Lam, Share, checked_dataclass
from roletrust_env.shapes import PerPair, PerProvider, PerRater
from roletrust_env.trees import FLAGS, SHARES, ValueRange
from roletrust_env.trust.ratings import PROVIDER, RATER, TINY, Published, Ratings, weighted_mean

STEPS = 80
"""Number of iterations. With these weightings the result is within 1e-6 of the fixed point."""

_ROUNDING = 4  # NumPy stops at a step of so many rounding errors of 1

_LINEAR, _EXPONENTIAL, _POWER = 0.5, 2.0, 0.05  # e (linear), b (exponential), e (power)


class FilteringState(NamedTuple):
    """Memory of iterative filtering.

    Attributes:
        tor: Trust of the raters, shape (S, ...): the weights divided by the largest.
        top: Trust of the providers, shape (P, ...): the weighted means.
        means: Mean of all ratings of each pair, shape (S, P, ...), 0 where there are none.
        rated: Flag, 1 where there are ratings, 0 elsewhere, shape (S, P, ...).
    """

    tor: Annotated[PerRater, SHARES]
    top: Annotated[PerProvider, SHARES]
    means: Annotated[PerPair, ValueRange(0, "rated")]
    rated: Annotated[PerPair, FLAGS]


@checked_dataclass
class IterativeFiltering(Published):
    """Iterative filtering: raters are weighted by their distance to the weighted mean, iterated
    until both agree.

    De Kerchove and Van Dooren (2010) give the scheme and the linear weighting. The power weighting,
    which is the default, is that of Laureti et al. (2006) and Yu et al. (2006), called iterative
    refinement:

        d[i] = mean over the providers j that i rated of (g[i, j] - r[j])^2
        u[i] = 1 - d[i] / (max d + 1/2)   "linear"
        u[i] = exp(-2 d[i])               "exponential"
        u[i] = (d[i] + 0.05)^(-1/2)       "power"
        r[j] = sum over the raters i of j of u[i] g[i, j] / sum of u[i]

    The iteration starts from equal weights and has a fixed number of steps. The papers leave 1/2, 2
    and 0.05 open; Laureti et al. take the power -1/2 or -1. They filter one matrix. Here g[i, j] is
    the exponential mean of the ratings that i gave j so far, which starts at the first of them, so
    that a rater that is silent in a round still counts. The model publishes r, and u divided by its
    largest entry: trust in a rater is relative to the best rater.

    Sharper weights would take sides without a reason: of two raters who disagree, rounding would
    decide which is right.

    Attributes:
        lam: Weight of the newest rating in the mean of each pair, in [0.5, 1).
        initial: Trust before any rating, in [0, 1].
        weighting: Formula for the weights: `"linear"`, `"exponential"` or `"power"`.
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    weighting: Literal["linear", "exponential", "power"] = "power"
    rates_raters = True
    source = "de Kerchove and Van Dooren (2010), Laureti et al. (2006), Yu et al. (2006)"

    def start(self, like: PerPair) -> FilteringState:
        """Return the state before any rating, with initial trust for all. See
        `TrustModel.start`.
        """
        xp = namespace(like)
        means, rated = xp.zeros_like(like), xp.zeros_like(like)
        return FilteringState(
            means[:, 0, ...] + self.initial, means[0] + self.initial, means, rated
        )

    def update(self, state: FilteringState, ratings: Ratings) -> FilteringState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp, pairs = namespace(ratings.values), ratings.pairs
        weight = 1 - (1 - self.lam) * state.rated
        means = state.means + weight * (ratings.write(state.means, ratings.values) - state.means)
        rated = ratings.write(state.rated, 1.0)
        given, received = pairs.reduce(rated, RATER), pairs.reduce(rated, PROVIDER)
        everyone = isinstance(means, np.ndarray) and bool(
            rated.all() and given.all()
        )  # so no flag counts
        rest = _ROUNDING * float(xp.finfo(means.dtype).eps)
        weights, worth = given, pairs.reduce(rated * means, PROVIDER) / (received + TINY)
        for _ in range(STEPS):
            before = worth
            apart = (means - pairs.gather(worth, PROVIDER)) ** 2
            distance = pairs.reduce(apart if everyone else rated * apart, RATER) / (given + TINY)
            least = smallest(distance if everyone else xp.where(given > 0, distance, 1.0))
            weights = self._weights(
                distance if everyone else xp.where(given > 0, distance, least), least
            )
            worth = weighted_mean(pairs, means, rated * pairs.gather(weights, RATER), PROVIDER)
            if isinstance(worth, np.ndarray) and abs(worth - before).max() <= rest:
                break
        return FilteringState(
            xp.where(given > 0, weights, self.initial),
            xp.where(received > 0, worth, self.initial),
            means,
            rated,
        )

    def _weights(self, distance: Array, least: Array) -> Array:
        """Return the weights u of the raters, divided by that of the least distance, which is the
        largest.
        """
        xp = namespace(distance)
        if self.weighting == "linear":
            most = largest(distance) + _LINEAR
            return (most - distance) / (most - least)
        if self.weighting == "exponential":
            return xp.exp(_EXPONENTIAL * (least - distance))
        return xp.sqrt((least + _POWER) / (distance + _POWER))
