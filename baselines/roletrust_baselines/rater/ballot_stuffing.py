"""The ballot stuffing attack."""

from typing import Annotated, Any

from roletrust_baselines.agent_indices import AgentIndices, provider_mask
from roletrust_baselines.rater.lying import LyingRater
from roletrust_env.arrays import Array
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import Accomplices, GridValues, Share


@checked_dataclass
class BallotStuffing(LyingRater):
    """Ballot stuffing: a rater that rates its accomplices better than they are.

    Dellarocas (2000), "Immunizing Online Reputation Reporting Systems"; the formula v (1 - k) + k is the exaggerated
    praise of Yu and Singh (2003).

    Attributes:
        level: Share k of the distance to 1 that is added to a rating, in [0, 1].
        accomplices: Indices of the accomplices among the providers; None praises all.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    level: Annotated[Share, GridValues(0.25, 0.5, 1.0)] = 1.0
    accomplices: Annotated[AgentIndices | None, Accomplices()] = None

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return praise of every provider. See `LyingRater.lies`."""
        return praise(view.service, self.level), memory

    def about(self, view: RaterView) -> Array:
        """Return a mask of the accomplices while active. See `LyingRater.about`."""
        active = self.active(view.round)
        if self.accomplices is None:
            return active
        return active & provider_mask(self.accomplices, view, "accomplices")


def praise(service: Array, level: float) -> Array:
    """Return ratings that are raised by a share of their distance to 1."""
    return service * (1 - level) + level
