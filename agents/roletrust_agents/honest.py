"""Honest play."""

from typing import Any

from roletrust_env.arrays import Array
from roletrust_env.game.policy import Policy
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import Share, checked_dataclass
from roletrust_env.randomness import Random


@checked_dataclass
class Honest(Policy):
    """Honest play: a provider serves as well as it can, and a rater reports the quality that it
    perceived.

    Attributes:
        best: Highest quality that the provider can reach, in [0, 1].
    """

    best: Share = 1.0

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the highest quality in every round. See `Policy.quality`."""
        return 0 * view.trust + self.best, memory
