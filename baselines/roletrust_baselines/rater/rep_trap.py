"""The RepTrap attack."""

from typing import Annotated, Any

from pydantic import PositiveInt

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange


@checked_dataclass
class RepTrap(TargetedLyingRater):
    """RepTrap: a rater that lies where a verdict is easily flipped, so that honest raters look like liars.

    Yang, Feng, Sun and Dai (2008), "RepTrap: A Novel Attack on Feedback-Based Reputation Systems". In the paper, the
    traps are objects with few ratings. A rater does not see the number of ratings in this game. In our interpretation,
    a trap is the target with the published trust nearest to 0.5. The rater is honest about all other providers, which
    keeps its own trust high.

    Attributes:
        traps: Number of providers that it lies about at a time.
        targets: Indices of the victims among the providers; None lies about all of them.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    traps: Annotated[PositiveInt, SearchRange(1, 5), GridValues(1, 2, 3)] = 1

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the opposite verdict on the traps, 0 or 1, and honest ratings otherwise. See `LyingRater.lies`."""
        xp, service = namespace(view.service), view.service
        unsettled = xp.where(view.awaiting & self.about(view), abs(view.published - 0.5), 1 + 0 * service)
        trap = xp.argsort(xp.argsort(unsettled, axis=0, stable=True), axis=0) < self.traps
        return xp.where(trap, cast(service < 0.5, service.dtype), service), memory
