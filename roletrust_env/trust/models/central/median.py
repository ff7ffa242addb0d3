"""The median: believe the rater in the middle."""

from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Notes
from roletrust_env.trust.robust import ByCentre, median


@checked_dataclass
class Median(ByCentre):
    """Median of a provider's ratings: it holds as long as fewer than half of the raters lie, and falls at half.

    Smoothing and the trust of raters are those of `ByCentre`.
    """

    source = "Huber (1981)"
    smooth = False  # whose rating is in the middle changes at once, and the others' have no slope
    cost = "S log S P"

    def centre(self, notes: Notes) -> Array:
        """See `ByCentre.centre`."""
        return median(notes)
