"""The deviation-weighted mean: believe a rater as far as it agrees with the average."""

from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Notes, Trusts, masked_mean, smooth, weighted_mean
from roletrust_env.trust.smoothed import Smoothed


@checked_dataclass
class DeviationWeighted(Smoothed):
    """Deviation-weighted mean: a rater counts by how little its ratings have deviated from the average ones.

        fbar[j] = mean over the raters i of j of f[i, j]
        R[i]   <- lam (1 - mean over the providers j that i rated of |f[i, j] - fbar[j]|) + (1 - lam) R[i]
        T[j]   <- lam (sum over the raters i of j of R[i] f[i, j] / sum of R[i]) + (1 - lam) T[j],   R as just updated

    Named for what it does: the literature has many of the kind, such as that of Liu et al. (2011), and it claims to
    match none of them.

    Attributes:
        lam: weight of the newest round, in [0.5, 1).
        initial: trust before any rating, in [0, 1].
    """

    takes_full_rounds = True

    def update(self, state: Trusts, ratings: Array, mask: Array | None) -> Trusts:
        """One round of ratings. See `TrustModel.update`."""
        notes = Notes.of(ratings, mask)
        average, received = masked_mean(notes.values, mask, axis=0)
        distance, given = masked_mean(abs(notes.values - average), mask, axis=1)
        tor = smooth(1 - distance, state.tor, self.lam, given)
        # Nobody is as far as 1 from an average that has a part in it, so those who rate weigh more than 0.
        quality = weighted_mean(notes.values, notes.weigh(tor[:, None, ...]), axis=0)
        return Trusts(tor, smooth(quality, state.top, self.lam, received))
