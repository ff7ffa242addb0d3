"""The trimmed mean: believe nobody at either end."""

from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import LessThanHalf
from roletrust_env.trust.algorithms import Notes
from roletrust_env.trust.robust import ByCentre, middle_mean


@checked_dataclass
class TrimmedMean(ByCentre):
    """Trimmed mean: of a provider's ratings, a share of the lowest and as many of the highest do not count.

    Of n ratings exactly `share` n are cut per side, so that one at the edge may count in part: cut down to a whole
    number, a quarter of three raters would be nobody. It holds against a share of liars up to `share`. Smoothing and
    the trust of raters are those of `ByCentre`.

    Attributes:
        share: of the ratings, cut per side, in [0, 0.5).
    """

    share: LessThanHalf = 0.25
    source = "Tukey and McLaughlin (1963)"
    smooth = False  # what is cut has no slope
    cost = "S log S P"

    def centre(self, notes: Notes) -> Array:
        """See `ByCentre.centre`."""
        return middle_mean(notes, self.share * notes.received)
