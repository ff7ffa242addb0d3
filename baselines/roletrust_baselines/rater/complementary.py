"""The complementary rating attack."""

from typing import Any

from pydantic.dataclasses import dataclass

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random


@dataclass(frozen=True)
class Complementary(TargetedLyingRater):
    """Complementary ratings: a rater that turns good into bad and bad into good.

    Yu and Singh (2003), "Detecting Deception in Reputation Management".

    Attributes:
        targets: places of the victims on the provider axis; None lies about all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """1 - the perceived quality. See `LyingRater.lies`."""
        return 1 - view.service, memory
