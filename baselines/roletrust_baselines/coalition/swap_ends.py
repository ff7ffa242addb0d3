"""The swap of the best and the worst provider."""

from typing import Annotated

from roletrust_baselines.coalition.agreement import AgreeingRater
from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import GridValues, Share


@checked_dataclass
class SwapEnds(AgreeingRater):
    """Swap of the ends: raters that sink the best provider and lift the worst, and are honest about the rest.

    `RankLies` lies about all providers, and `Promotion` about all that are better than one. These raters lie about two
    providers, however many there are. If two are equally good, neither is the best or the worst. This attack is not
    from a paper.

    Attributes:
        sink: Share by which the rating of the best provider is reduced, in [0, 1].
        lift: Share of the distance to 1 that is added to the rating of the worst provider, in [0, 1].
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or published trust before the
            first; `"published"` is published trust.
        accomplices: Indices of the accomplices among the providers. They are always rated 1 and have no rank. None is
            a coalition without accomplices.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    sink: Annotated[Share, GridValues(0.6, 1.0)] = 1.0
    lift: Annotated[Share, GridValues(0.5, 1.0)] = 1.0

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return the ratings with those of the ends reduced and raised. See `AgreeingRater.lies`."""
        xp = namespace(ranks)
        lies = xp.where(ranks == 1, estimates * (1 - self.lift) + self.lift, estimates)
        return xp.where(ranks == 0, estimates * (1 - self.sink), lies)
