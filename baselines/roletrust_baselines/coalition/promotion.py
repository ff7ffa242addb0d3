"""The promotion of a mediocre provider."""

from typing import Annotated

from roletrust_baselines.coalition.agreement import AgreeingRater
from roletrust_baselines.coalition.estimates import STEPS
from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import GridValues, Share


@checked_dataclass
class Promotion(AgreeingRater):
    """Promotion: raters that lift one mediocre honest provider above all better ones, and are honest about the rest.

    After the push and nuke attacks on recommender systems of O'Mahony et al. (2004), "Collaborative Recommendation: A
    Robustness Analysis", which promote and demote items. A lie about few providers costs the raters little trust.

    Attributes:
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

    place: Annotated[Share, GridValues(0.2, 0.4, 0.7)] = 0.4
    lift: Annotated[Share, GridValues(0.5, 1.0)] = 1.0
    sink: Annotated[Share, GridValues(0.6, 1.0)] = 1.0

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return raised, reduced and honest ratings by rank. See `AgreeingRater.lies`."""
        xp = namespace(ranks)
        distance = xp.round(abs(ranks - self.place) * STEPS) + ranks / 2  # whole steps, and the better one of two
        promoted = distance == xp.min(distance, axis=0, keepdims=True)
        better = ranks < xp.min(xp.where(promoted, ranks, 1 + 0 * ranks), axis=0)
        lies = xp.where(better, estimates * (1 - self.sink), estimates)
        return xp.where(promoted, estimates * (1 - self.lift) + self.lift, lies)
