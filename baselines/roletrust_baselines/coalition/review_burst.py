"""Bursts of lies."""

from typing import Annotated

from pydantic import PositiveInt

from roletrust_baselines.coalition.rank_lies import Bend, RankLies
from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import GridValues, SearchRange


@checked_dataclass
class ReviewBurst(RankLies):
    """Review bursts: raters that lie by rank at the same time, for a few rounds of every period.

    Spam reviews come in bursts: Fei et al. (2013), "Exploiting Burstiness in Reviews for Review Spammer Detection".
    Between two bursts the raters are honest and repair their trust. The curve from rank to rating is our choice.

    Attributes:
        burst: Number of rounds of lies at the beginning of each period.
        every: Number of rounds of a period.
        best: Rating of the best provider, in [0, 1].
        worst: Rating of the worst provider, in [0, 1].
        bend: Exponent of the rank in the curve between them, in (0, 8]. Below 1 all but the best
            providers are praised.
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or published trust before the
            first; `"published"` is published trust.
        accomplices: Indices of the accomplices among the providers. They are always rated 1 and have no rank. None is
            a coalition without accomplices.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    bend: Annotated[Bend, GridValues(0.25, 1.0, 2.0)] = 0.25
    burst: Annotated[PositiveInt, SearchRange(1, 12), GridValues(2, 4)] = 4
    every: Annotated[PositiveInt, SearchRange(1, 24), GridValues(6, 12)] = 6

    def active(self, round: Array) -> Array:
        """Return whether a burst is going on. See `WindowedAttack.active`."""
        return super().active(round) & ((round - self.start) % self.every < self.burst)
