"""The RepTrap attack."""

from typing import Annotated, Any

from pydantic import PositiveInt
from pydantic.dataclasses import dataclass

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange


@dataclass(frozen=True)
class RepTrap(TargetedLyingRater):
    """RepTrap: a rater that lies where a verdict is easily flipped, so that those who tell the truth look like liars.

    Yang, Feng, Sun and Dai (2008), "RepTrap: A Novel Attack on Feedback-Based Reputation Systems". There the traps are
    objects with few ratings. A rater does not see how many there are; the reading here is that a trap is the target
    whose published trust is nearest to 0.5, and that about the others it tells the truth, which keeps its own trust.

    Attributes:
        traps: providers that it lies about at a time.
        targets: places of the victims on the provider axis; None lies about all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    traps: Annotated[PositiveInt, SearchRange(1, 5), GridValues(1, 2, 3)] = 1

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """The opposite verdict on the traps, 0 or 1, and the truth elsewhere. See `LyingRater.lies`."""
        xp, service = namespace(view.service), view.service
        unsettled = xp.where(view.awaiting & self.about(view), abs(view.published - 0.5), 1 + 0 * service)
        trap = xp.argsort(xp.argsort(unsettled, axis=0, stable=True), axis=0) < self.traps
        return xp.where(trap, cast(service < 0.5, service.dtype), service), memory
