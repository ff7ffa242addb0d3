"""The common part of models with a robust centre: means that outliers move little, raters judged by their distance."""

from abc import abstractmethod

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Trusts, smooth
from roletrust_env.trust.ratings import Ratings
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
    xp, count = namespace(ratings.values), ratings.received
    cells, values, place = ratings.in_order()
    kept = xp.clip(cells.of_providers(count - cut) - place, 0, 1) - xp.clip(cells.of_providers(cut) - place, 0, 1)
    return cells.weighted_mean_over_raters(xp.where(place < cells.of_providers(count), values, 0.0), kept)


def median(ratings: Ratings) -> Array:
    """Return the median of each provider's ratings, shape (P, ...); of an even number, the mean of the middle two."""
    return middle_mean(ratings, (ratings.received - 1) / 2)


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

    takes_full_rounds = True

    @abstractmethod
    def centre(self, ratings: Ratings) -> Array:
        """Return the centre of each provider's ratings, shape (P, ...), in [0, 1] also for an unrated provider."""

    def after_round(self, state: Trusts, ratings: Ratings) -> Trusts:
        """Return the state after one round of ratings. See `Central.after_round`."""
        centre = self.centre(ratings)
        distance = ratings.mean_over_providers(abs(ratings.values - ratings.of_providers(centre)))
        tor = smooth(1 - distance, state.tor, self.lam, ratings.given)
        return Trusts(tor, smooth(centre, state.top, self.lam, ratings.received))
