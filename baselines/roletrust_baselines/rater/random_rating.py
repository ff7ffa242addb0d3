"""The random rating attack."""

from typing import Any

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array, cast
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random


@checked_dataclass
class RandomRating(TargetedLyingRater):
    """Random ratings: a rater with ratings drawn from U[0, 1), which carry no information.

    This is the random scenario of ATB (Jelenc et al. 2013).

    Attributes:
        targets: Indices of the victims among the providers; None lies about all of them.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return random ratings. See `LyingRater.lies`."""
        return cast(random.uniform(view.service.shape), view.service.dtype), memory
