"""The random rating attack."""

from typing import Any

from pydantic.dataclasses import dataclass

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array, cast
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random


@dataclass(frozen=True)
class RandomRating(TargetedLyingRater):
    """Random ratings: a rater whose notes are drawn from U[0, 1) and say nothing.

    The random scenario of ATB (Jelenc et al. 2013).

    Attributes:
        targets: places of the victims on the provider axis; None lies about all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Anything. See `LyingRater.lies`."""
        return cast(random.uniform(view.service.shape), view.service.dtype), memory
