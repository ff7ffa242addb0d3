"""The deviation-weighted mean: raters count by their agreement with the average."""

from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Trusts
from roletrust_env.trust.ratings import PROVIDER, RATER, Ratings, mean, smooth, weighted_mean
from roletrust_env.trust.smoothed import Smoothed


@checked_dataclass
class DeviationWeighted(Smoothed):
    """Deviation-weighted mean: the less a rater has deviated from the average rating, the more it counts.

        fbar[j] = mean over the raters i of j of f[i, j]
        R[i]   <- lam (1 - mean over the providers j that i rated of |f[i, j] - fbar[j]|) + (1 - lam) R[i]
        T[j]   <- lam (sum over the raters i of j of R[i] f[i, j] / sum of R[i]) + (1 - lam) T[j],   R as just updated

    The literature has many models of this kind, such as that of Liu et al. (2011). This one claims to match none of
    them, and is named for what it does.

    Attributes:
        lam: Weight of the newest round, in [0.5, 1).
        initial: Trust before any rating, in [0, 1].
    """

    def update(self, state: Trusts, ratings: Ratings) -> Trusts:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        average = mean(ratings, ratings.values, PROVIDER)
        distance = mean(ratings, abs(ratings.values - ratings.gather(average, PROVIDER)), RATER)
        tor = smooth(1 - distance, state.tor, self.lam, ratings.count(RATER))
        # A rating is nearer than 1 to an average that includes it, so weights are above 0.
        quality = weighted_mean(ratings, ratings.values, ratings.weigh(ratings.gather(tor, RATER)), PROVIDER)
        return Trusts(tor, smooth(quality, state.top, self.lam, ratings.count(PROVIDER)))
