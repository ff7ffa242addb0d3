"""Lies by rank."""

from typing import Annotated

from pydantic import Field

from roletrust_baselines.coalition.agreement import AgreeingRater
from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import GridValues, SearchRange, Share


@checked_dataclass
class RankLies(AgreeingRater):
    """Lies by rank: raters that agree on a rating for each rank, by default the worst provider's is the highest.

    After Mukherjee, Liu and Glance (2012), "Spotting Fake Reviewer Groups in Consumer Reviews": groups of reviewers
    work together to promote or to demote targets. The curve from rank to rating is our choice. Complementary ratings
    bring the means of all providers closer together; these ratings turn their order around.

    Attributes:
        best: Rating of the best provider, in [0, 1].
        worst: Rating of the worst provider, in [0, 1].
        bend: Exponent of the rank in the curve between them, in (0, 8]. Above 1 only the worst providers are praised.
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or published trust before the
            first; `"published"` is published trust.
        accomplices: Indices of the accomplices among the providers. They are always rated 1 and have no rank. None is
            a coalition without accomplices.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    best: Annotated[Share, GridValues(0.0, 0.3)] = 0.0
    worst: Annotated[Share, GridValues(0.5, 1.0)] = 1.0
    bend: Annotated[float, Field(gt=0, le=8), SearchRange(0.25, 4), GridValues(0.25, 1.0, 2.0)] = 2.0

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return the rating of each rank. See `AgreeingRater.lies`."""
        return self.best + (self.worst - self.best) * ranks**self.bend
