"""The bad-mouthing attack (BMA)."""

from typing import Annotated, Any, Literal

from pydantic.dataclasses import dataclass

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@dataclass(frozen=True)
class BadMouthing(TargetedLyingRater):
    """Bad-mouthing attack (BMA): a rater that rates good services low.

    Su and Saint-Jore (EWSN 2023), section 3, Figure 4: the constant note 0.5.

    Attributes:
        lie: `"constant"` rates `level` whatever it receives; `"relative"` rates (1 - level) * what it perceived.
        level: of the constant lie, the note; of the relative lie, the share of the note that is withheld; in [0, 1].
        targets: places of the victims on the provider axis; None lies about all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    lie: Annotated[Literal["constant", "relative"], GridValues("constant")] = "constant"
    level: Annotated[Share, GridValues(0.0, 0.25, 0.5, 0.75)] = 0.5

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """The note, or what is left of the perceived one. See `LyingRater.lies`."""
        return view.service * (1 - self.level) if self.lie == "relative" else 0 * view.service + self.level, memory
