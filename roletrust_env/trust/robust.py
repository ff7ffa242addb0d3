"""The common part of models with a robust centre: means that outliers move little, raters judged by their distance."""

from abc import abstractmethod

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Trusts
from roletrust_env.trust.ratings import PROVIDER, RATER, Ratings, mean, smooth, weighted_mean
from roletrust_env.trust.smoothed import Smoothed


def middle_mean(ratings: Ratings, cut: Array) -> Array:
    """Return the mean of each provider's n ratings after cutting some of the lowest and as many of the highest.

    A rating may be cut in part and then counts with the rest of its weight. With (n - 1) / 2 cut per side, the mean is
    the median.

    Args:
        ratings: Ratings of the round.
        cut: Number of ratings to cut per side, shape (P, ...) or one number, less than n / 2 where n > 0.

    Returns:
        Shape (P, ...); 0 where there are no ratings.
    """
    xp, count = namespace(ratings.values), ratings.count(PROVIDER)
    cells, values, place = ratings.sorted_by_provider()
    kept = xp.clip(cells.gather(count - cut, PROVIDER) - place, 0, 1) - xp.clip(
        cells.gather(cut, PROVIDER) - place, 0, 1
    )
    return weighted_mean(cells, xp.where(place < cells.gather(count, PROVIDER), values, 0.0), kept, PROVIDER)


def median(ratings: Ratings) -> Array:
    """Return the median of each provider's ratings, shape (P, ...); of an even number, the mean of the middle two."""
    return middle_mean(ratings, (ratings.count(PROVIDER) - 1) / 2)


@checked_dataclass
class ByCentre(Smoothed):
    """Base of trust models that are defined by a centre of each provider's ratings. Both trusts follow from it.

        centre[j] = the model's own, of f[i, j] over the raters i of j
        T[j]     <- lam centre[j] + (1 - lam) T[j]
        R[i]     <- lam (1 - mean over the providers j that i rated of |f[i, j] - centre[j]|) + (1 - lam) R[i]

    Attributes:
        lam: Weight of the newest round, in [0.5, 1).
        initial: Trust before any rating, in [0, 1].
    """

    @abstractmethod
    def centre(self, ratings: Ratings) -> Array:
        """Return the centre of each provider's ratings, shape (P, ...), in [0, 1] also for an unrated provider."""

    def update(self, state: Trusts, ratings: Ratings) -> Trusts:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        centre = self.centre(ratings)
        distance = mean(ratings, abs(ratings.values - ratings.gather(centre, PROVIDER)), RATER)
        tor = smooth(1 - distance, state.tor, self.lam, ratings.count(RATER))
        return Trusts(tor, smooth(centre, state.top, self.lam, ratings.count(PROVIDER)))
