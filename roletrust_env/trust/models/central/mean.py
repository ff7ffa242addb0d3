"""The undefended baseline: the average rating."""

from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Trusts, smooth
from roletrust_env.trust.ratings import Ratings
from roletrust_env.trust.smoothed import Smoothed


@checked_dataclass
class Mean(Smoothed):
    """Undefended baseline: exponential mean of a provider's average rating, in which all raters count alike.

    Attributes:
        lam: Weight of the newest round, in [0.5, 1).
        initial: Trust before any rating, in [0, 1].
    """

    rates_raters = False
    takes_full_rounds = True

    def start(self, like: Array) -> Trusts:
        """Return the initial trust of the providers, and 1 for every rater. See `TrustModel.start`."""
        nobody, top = super().start(like)
        return Trusts(0 * nobody + 1, top)

    def after_round(self, state: Trusts, ratings: Ratings) -> Trusts:
        """Return the state after one round of ratings. See `Central.after_round`."""
        average = ratings.mean_over_raters(ratings.values)
        return Trusts(state.tor, smooth(average, state.top, self.lam, ratings.received))
