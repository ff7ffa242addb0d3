"""The bad-mouthing attack (BMA)."""

from typing import Annotated, Any, Literal

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@checked_dataclass
class BadMouthing(TargetedLyingRater):
    """Bad-mouthing attack (BMA): a rater that rates good services low.

    Su and Saint-Jore (EWSN 2023), section 3, Figure 4, with a constant rating of 0.5.

    Attributes:
        lie: Kind of lie: `"constant"` always rates `level`; `"relative"` rates (1 - level) * perceived quality.
        level: Rating of the constant lie, or share by which the relative lie reduces a rating; in [0, 1].
        targets: Indices of the victims among the providers; None lies about all of them.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    lie: Annotated[Literal["constant", "relative"], GridValues("constant")] = "constant"
    level: Annotated[Share, GridValues(0.0, 0.25, 0.5, 0.75)] = 0.5

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the constant rating, or the reduced perceived quality. See `LyingRater.lies`."""
        return view.service * (1 - self.level) if self.lie == "relative" else 0 * view.service + self.level, memory
