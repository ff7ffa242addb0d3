"""The common part of models with a robust centre: means that outliers move little, raters judged by their distance."""

from abc import ABC, abstractmethod

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import MaskedRatings, Trusts, masked_mean, smooth, weighted_mean
from roletrust_env.trust.smoothed import Smoothed


def middle_mean(masked: MaskedRatings, cut: Array) -> Array:
    """Return the mean of each provider's n ratings after cutting some of the lowest and as many of the highest.

    A rating may be cut in part and then counts with the rest of its weight. With (n - 1) / 2 cut per side, the mean is
    the median.

    Args:
        masked: Ratings of the round.
        cut: Number of ratings to cut per side, shape (P, ...) or one number, less than n / 2 where n > 0.

    Returns:
        Shape (P, ...); 0 where there are no ratings.
    """
    xp, values, count = namespace(masked.values), masked.values, masked.received
    if masked.weights is not None:
        values = xp.where(masked.weights > 0, values, float("inf"))  # absent ratings come last
    place = xp.arange(len(values), dtype=values.dtype, device=values.device).reshape(-1, *[1] * (values.ndim - 1))
    kept = xp.clip(count - cut - place, 0, 1) - xp.clip(cut - place, 0, 1)
    return weighted_mean(xp.where(place < count, xp.sort(values, axis=0), 0.0), kept, axis=0)


def median(masked: MaskedRatings) -> Array:
    """Return the median of each provider's ratings, shape (P, ...); of an even number, the mean of the middle two."""
    return middle_mean(masked, (masked.received - 1) / 2)


@checked_dataclass
class ByCentre(Smoothed, ABC):
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
    def centre(self, masked: MaskedRatings) -> Array:
        """Return the centre of each provider's ratings, shape (P, ...), in [0, 1] also for an unrated provider."""

    def update(self, state: Trusts, ratings: Array, mask: Array | None) -> Trusts:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        masked = MaskedRatings.of(ratings, mask)
        centre = self.centre(masked)
        distance, given = masked_mean(abs(masked.values - centre), mask, axis=1)
        tor = smooth(1 - distance, state.tor, self.lam, given)
        return Trusts(tor, smooth(centre, state.top, self.lam, masked.received))
