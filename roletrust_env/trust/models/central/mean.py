"""The undefended baseline: the average rating."""

from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Trusts
from roletrust_env.trust.ratings import PROVIDER, Ratings, mean, smooth
from roletrust_env.trust.smoothed import Smoothed


@checked_dataclass
class Mean(Smoothed):
    """Undefended baseline: exponential mean of a provider's average rating, in which all raters count alike.

    Attributes:
        lam: Weight of the newest round, in [0.5, 1).
        initial: Trust before any rating, in [0, 1].
    """

    rates_raters = False

    def start(self, like: Array) -> Trusts:
        """Return the initial trust of the providers, and 1 for every rater. See `TrustModel.start`."""
        nobody, top = super().start(like)
        return Trusts(0 * nobody + 1, top)

    def update(self, state: Trusts, ratings: Ratings) -> Trusts:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        average = mean(ratings, ratings.values, PROVIDER)
        return Trusts(state.tor, smooth(average, state.top, self.lam, ratings.count(PROVIDER)))
