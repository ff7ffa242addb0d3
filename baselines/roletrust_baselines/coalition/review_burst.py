"""Bursts of reviews."""

from typing import Annotated

from pydantic import PositiveInt

from roletrust_baselines.coalition.promotion import Promotion
from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import GridValues, SearchRange, Share


@checked_dataclass
class ReviewBurst(Promotion):
    """Review bursts: raters that promote a mediocre provider at the same time, for a few rounds of every period.

    Spammers often review together in bursts: Fei et al. (2013), "Exploiting Burstiness in Reviews for Review Spammer
    Detection". Between two bursts the raters are honest and repair their trust. The rule of the lies is our choice.

    Attributes:
        burst: Number of rounds of lies at the beginning of each period.
        every: Number of rounds of a period.
        place: Rank of the promoted provider from 0, the best, to 1. It is the provider with the nearest rank, the
            better one of two.
        lift: Share of the distance to 1 that is added to its rating, in [0, 1].
        sink: Share by which ratings of better providers are reduced, in [0, 1].
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or published trust before the
            first; `"published"` is published trust.
        accomplices: Indices of the accomplices among the providers. They are always rated 1 and have no rank. None is
            a coalition without accomplices.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    place: Annotated[Share, GridValues(0.3, 0.6)] = 0.3
    burst: Annotated[PositiveInt, SearchRange(1, 12), GridValues(2, 4)] = 4
    every: Annotated[PositiveInt, SearchRange(1, 24), GridValues(6, 12)] = 6

    def active(self, round: Array) -> Array:
        """Return whether a burst is going on. See `WindowedAttack.active`."""
        return super().active(round) & ((round - self.start) % self.every < self.burst)
