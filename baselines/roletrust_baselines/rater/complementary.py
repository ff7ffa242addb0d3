"""The complementary rating attack."""

from typing import Any

from roletrust_baselines.rater.lying import TargetedLyingRater
from roletrust_env.arrays import Array
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random


@checked_dataclass
class Complementary(TargetedLyingRater):
    """Complementary ratings: a rater that rates good services as bad and bad ones as good.

    Yu and Singh (2003), "Detecting Deception in Reputation Management".

    Attributes:
        targets: Indices of the victims among the providers; None lies about all of them.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return 1 minus the perceived quality. See `LyingRater.lies`."""
        return 1 - view.service, memory
