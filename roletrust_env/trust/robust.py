"""What the models with a robust centre share: means that outliers move little, and raters judged by their distance."""

from abc import ABC, abstractmethod

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Notes, Trusts, masked_mean, smooth, weighted_mean
from roletrust_env.trust.smoothed import Smoothed


def middle_mean(notes: Notes, cut: Array) -> Array:
    """The mean of what is left of each provider's n ratings when so many of the lowest and of the highest are cut.

    A part of a rating may be cut: the rest of it then counts for so much. With (n - 1) / 2 cut per side, what is left
    is the median.

    Args:
        notes: of the round.
        cut: how many to cut per side, shape (P, ...) or one number, less than n / 2 where n > 0.

    Returns:
        Shape (P, ...); 0 where there are no ratings.
    """
    xp, values, count = namespace(notes.values), notes.values, notes.received
    if notes.weights is not None:
        values = xp.where(notes.weights > 0, values, float("inf"))  # absent ones come last
    place = xp.arange(len(values), dtype=values.dtype, device=values.device).reshape(-1, *[1] * (values.ndim - 1))
    kept = xp.clip(count - cut - place, 0, 1) - xp.clip(cut - place, 0, 1)
    return weighted_mean(xp.where(place < count, xp.sort(values, axis=0), 0.0), kept, axis=0)


def median(notes: Notes) -> Array:
    """The median of each provider's ratings, of an even number the mean of the two in the middle, shape (P, ...)."""
    return middle_mean(notes, (notes.received - 1) / 2)


@checked_dataclass
class ByCentre(Smoothed, ABC):
    """A trust model that is told by how it takes the centre of a provider's ratings; both trusts follow from that.

        centre[j] = the model's own, of f[i, j] over the raters i of j
        T[j]     <- lam centre[j] + (1 - lam) T[j]
        R[i]     <- lam (1 - mean over the providers j that i rated of |f[i, j] - centre[j]|) + (1 - lam) R[i]

    Attributes:
        lam: weight of the newest round, in [0.5, 1).
        initial: trust before any rating, in [0, 1].
    """

    takes_full_rounds = True

    @abstractmethod
    def centre(self, notes: Notes) -> Array:
        """The centre of each provider's ratings, shape (P, ...), in [0, 1] also where nobody rated it."""

    def update(self, state: Trusts, ratings: Array, mask: Array | None) -> Trusts:
        """One round of ratings. See `TrustModel.update`."""
        notes = Notes.of(ratings, mask)
        centre = self.centre(notes)
        distance, given = masked_mean(abs(notes.values - centre), mask, axis=1)
        tor = smooth(1 - distance, state.tor, self.lam, given)
        return Trusts(tor, smooth(centre, state.top, self.lam, notes.received))
