"""The Huber mean: believe the distant less."""

from pydantic import PositiveFloat

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Notes, weighted_mean
from roletrust_env.trust.robust import ByCentre, median

STEPS = 30
"""Of reweighting, after which the centre is within 1e-6 of where it would stay."""


@checked_dataclass
class HuberMean(ByCentre):
    """Huber mean: a provider's ratings near the centre count in full, others the less the further away they are.

    Huber (1964), with a fixed width in place of an estimated scale, since ratings have one already:

        centre = sum over raters i of w[i] f[i] / sum of w[i],   w[i] = min(1, width / |f[i] - centre|)

    by a fixed number of steps from the median. Smoothing and the trust of raters are those of `ByCentre`.

    Attributes:
        width: distance from the centre up to which a rating counts in full, above 0; from 1 on, this is the mean.
    """

    width: PositiveFloat = 0.1
    source = "Huber (1964)"
    cost = "S log S P"

    def centre(self, notes: Notes) -> Array:
        """See `ByCentre.centre`."""
        xp, centre = namespace(notes.values), median(notes)
        for _ in range(STEPS):
            weights = notes.weigh(self.width / xp.clip(abs(notes.values - centre), self.width, None))
            centre = weighted_mean(notes.values, weights, axis=0)
        return centre
