"""The deviation-weighted mean: raters count by their agreement with the average."""

from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Trusts, smooth
from roletrust_env.trust.ratings import Ratings
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

    takes_full_rounds = True

    def after_round(self, state: Trusts, ratings: Ratings) -> Trusts:
        """Return the state after one round of ratings. See `Central.after_round`."""
        average = ratings.mean_over_raters(ratings.values)
        distance = ratings.mean_over_providers(abs(ratings.values - ratings.of_providers(average)))
        tor = smooth(1 - distance, state.tor, self.lam, ratings.given)
        # A rating is nearer than 1 to an average that includes it, so weights are above 0.
        quality = ratings.weighted_mean_over_raters(ratings.values, ratings.weigh(ratings.of_raters(tor)))
        return Trusts(tor, smooth(quality, state.top, self.lam, ratings.received))
