"""The all-time mean: the average of all ratings so far."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Share, checked_dataclass
from roletrust_env.trust.ratings import PROVIDER, PerProvider, PerRater, Ratings


class AllTimeMeanState(NamedTuple):
    """Memory of the all-time mean.

    Attributes:
        tor: Trust of the raters, shape (S, ...), always 1.
        sums: Sum of all ratings of each provider, shape (P, ...).
        counts: Number of these ratings, shape (P, ...).
    """

    tor: PerRater
    sums: PerProvider
    counts: PerProvider


@checked_dataclass
class AllTimeMean:
    """All-time mean: a provider's average rating so far, in which all ratings count alike and none is forgotten.

        T[j] = sum of all ratings of j / their number

    Attributes:
        initial: Trust before any rating, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = False
    local = True

    def start(self, like: Array) -> AllTimeMeanState:
        """Return the state before any rating. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return AllTimeMeanState(nothing[:, 0, ...] + 1, nothing[0], nothing[0])

    def update(self, state: AllTimeMeanState, ratings: Ratings) -> AllTimeMeanState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        sums = state.sums + ratings.reduce(ratings.values, PROVIDER)
        return AllTimeMeanState(state.tor, sums, state.counts + ratings.count(PROVIDER))

    def rater_trust(self, state: AllTimeMeanState) -> Array:
        """Return 1 for every rater, shape (S, ...), since the model has no notion of rater trust."""
        return state.tor

    def provider_trust(self, state: AllTimeMeanState) -> Array:
        """Return the mean of all ratings, shape (P, ...)."""
        xp = namespace(state.sums)
        return xp.where(state.counts > 0, state.sums / xp.clip(state.counts, 1, None), self.initial)
