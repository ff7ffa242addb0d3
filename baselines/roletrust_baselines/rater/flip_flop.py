"""The flip-flop rating attack."""

from typing import Annotated, Any

from pydantic import PositiveInt

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array, cast
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange


@checked_dataclass
class FlipFlop(TargetedLyingRater):
    """Flip-flop ratings: a rater that rates 1 and 0 in turn, whatever it perceives.

    It exploits the stability term of a model: the trust of the providers oscillates although their service does not.
    The attack is strongest if several raters play it in step.

    Attributes:
        period: Number of successive rounds with a rating of 1, followed by as many with a rating of 0.
        targets: Indices of the victims among the providers; None lies about all of them.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    period: Annotated[PositiveInt, SearchRange(1, 12), GridValues(1, 2, 5)] = 1

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return ratings of 1 and 0 in turn. See `LyingRater.lies`."""
        praises = (view.round - self.start) % (2 * self.period) < self.period
        return 0 * view.service + cast(praises, view.service.dtype), memory
