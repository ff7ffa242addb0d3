"""The median of the ratings."""

from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.ratings import Ratings
from roletrust_env.trust.robust import ByCentre, median


@checked_dataclass
class Median(ByCentre):
    """Median of a provider's ratings: robust as long as fewer than half of the raters lie.

    Smoothing and the trust of raters are those of `ByCentre`.
    """

    source = "Huber (1981)"
    differentiable = False  # the middle rating changes from one rater to another, and the others have no slope
    cost = "S log S P"

    def centre(self, ratings: Ratings) -> Array:
        """Return the median of each provider's ratings. See `ByCentre.centre`."""
        return median(ratings)
