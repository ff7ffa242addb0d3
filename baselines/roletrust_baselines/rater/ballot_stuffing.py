"""The ballot stuffing attack."""

from typing import Annotated, Any

from pydantic.dataclasses import dataclass

from roletrust_baselines.agent_indices import AgentIndices, index_mask
from roletrust_baselines.rater.lying import LyingRater
from roletrust_env.arrays import Array
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import Accomplices, GridValues, Share


@dataclass(frozen=True)
class BallotStuffing(LyingRater):
    """Ballot stuffing: a rater that rates its accomplices better than they are.

    Dellarocas (2000), "Immunizing Online Reputation Reporting Systems"; the formula v (1 - k) + k is the exaggerated
    praise of Yu and Singh (2003).

    Attributes:
        level: share k of what a note lacks to 1 that is added, in [0, 1].
        accomplices: their places on the provider axis; None praises all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    level: Annotated[Share, GridValues(0.25, 0.5, 1.0)] = 1.0
    accomplices: Annotated[AgentIndices | None, Accomplices()] = None

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Praise. See `LyingRater.lies`."""
        return praise(view.service, self.level), memory

    def about(self, view: RaterView) -> Array:
        """The accomplices, while active. See `LyingRater.about`."""
        active = self.active(view.round)
        return (
            active if self.accomplices is None else active & index_mask(self.accomplices, view.service, "accomplices")
        )


def praise(service: Array, level: float) -> Array:
    """Notes with a share of what they lack to 1 added."""
    return service * (1 - level) + level
