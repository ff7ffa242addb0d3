"""The optimistic rating attack."""

from typing import Any

from pydantic.dataclasses import dataclass

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random


@dataclass(frozen=True)
class Optimistic(TargetedLyingRater):
    """Optimistic ratings: a rater that sees everything half as bad, (x + 1) / 2 on the scale [-1, 1].

    The ratings of `BallotStuffing(level=0.5)`, about targets: praise of honest providers.

    Attributes:
        targets: places of the victims on the provider axis; None lies about all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Half way from the perceived quality to 1. See `LyingRater.lies`."""
        return (view.service + 1) / 2, memory
