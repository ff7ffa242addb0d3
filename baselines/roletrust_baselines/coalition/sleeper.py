"""Sleepers that lie by rank."""

from typing import Annotated, Any

from pydantic import NonNegativeInt

from roletrust_baselines.coalition.rank_lies import RankLies
from roletrust_env.arrays import Array
from roletrust_env.game.schedule import asleep, wake
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange, Share


@checked_dataclass
class Sleeper(RankLies):
    """Sleepers: raters that are honest until they are trusted, and lie by rank together from then on.

    The camouflage attack of Irissappane, Jiang and Zhang (2012) by a coalition. Sleepers have no noise of their own, so
    that they are trusted more than honest raters when they wake up.

    Attributes:
        wakes_at: Own ToR from which on a rater lies, permanently, in [0, 1]. With 0 it wakes up at the start.
        best: Rating of the best provider, in [0, 1].
        worst: Rating of the worst provider, in [0, 1].
        bend: Exponent of the rank in the curve between them, in (0, 8]. Above 1 only the worst providers are praised.
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or published trust before the
            first; `"published"` is published trust.
        accomplices: Indices of the accomplices among the providers. They are always rated 1 and have no rank. None is
            a coalition without accomplices.
        start: First round in which a rater can wake up.
        stop: First round after the attack; None attacks to the end.
    """

    start: Annotated[NonNegativeInt, SearchRange(0, 100), GridValues(5, 20)] = 5
    wakes_at: Annotated[Share, GridValues(0.0, 0.7)] = 0.7

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return a memory without perceptions, asleep. See `Policy.begin`."""
        return super().begin(random, shape), asleep(random, shape)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return false ratings once it is awake, and its estimates before. See `Policy.ratings`."""
        estimates = memory[0].after(view)
        awake, woken = wake(self.active(view.round) & (view.trust >= self.wakes_at), memory[1])
        lying = awake if self.stop is None else awake & (view.round < self.stop)
        return self.reports(view, estimates, lying), (estimates, woken)
