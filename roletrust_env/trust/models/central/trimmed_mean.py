"""The trimmed mean: the ratings at both ends do not count."""

from roletrust_env.arrays import Array
from roletrust_env.parameters import LessThanHalf, checked_dataclass
from roletrust_env.trust.ratings import PROVIDER, Ratings
from roletrust_env.trust.robust import ByCentre, middle_mean


@checked_dataclass
class TrimmedMean(ByCentre):
    """Trimmed mean: a share of the lowest ratings of a provider and as many of the highest do not count.

    Exactly `share` n of n ratings are cut per side, so a rating at the edge may count in part. Rounded down to a whole
    number, a quarter of three raters would be none. The model is robust up to a share of liars of `share`. Smoothing
    and the trust of raters are those of `ByCentre`.

    Attributes:
        share: Share of the ratings that is cut per side, in [0, 0.5).
    """

    share: LessThanHalf = 0.25
    source = "Tukey and McLaughlin (1963)"
    differentiable = False  # a rating that is cut has no slope
    cost = "S log S P"

    def centre(self, ratings: Ratings) -> Array:
        """Return the trimmed mean of each provider's ratings. See `ByCentre.centre`."""
        return middle_mean(ratings, self.share * ratings.count(PROVIDER))
