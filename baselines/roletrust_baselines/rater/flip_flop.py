"""The flip-flop rating attack."""

from typing import Annotated, Any

from pydantic import PositiveInt
from pydantic.dataclasses import dataclass

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array, cast
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange


@dataclass(frozen=True)
class FlipFlop(TargetedLyingRater):
    """Flip-flop ratings: a rater that praises and condemns by turns, whatever it receives.

    It turns a model's stability term against the providers: their trust swings though their service does not. Best
    played by several in step.

    Attributes:
        period: rounds of 1, then as many of 0.
        targets: places of the victims on the provider axis; None lies about all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    period: Annotated[PositiveInt, SearchRange(1, 12), GridValues(1, 2, 5)] = 1

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """1 and 0 by turns. See `LyingRater.lies`."""
        praises = (view.round - self.start) % (2 * self.period) < self.period
        return 0 * view.service + cast(praises, view.service.dtype), memory
