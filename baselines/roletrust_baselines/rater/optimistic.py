"""The optimistic rating attack."""

from typing import Any

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random


@checked_dataclass
class Optimistic(TargetedLyingRater):
    """Optimistic ratings: a rater that halves the distance of each rating to the best, (x + 1) / 2 on [-1, 1].

    The ratings are those of `BallotStuffing(level=0.5)`, but for honest providers, the targets.

    Attributes:
        targets: Indices of the victims among the providers; None lies about all of them.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the mean of the perceived quality and 1. See `LyingRater.lies`."""
        return (view.service + 1) / 2, memory
