"""Honest play."""

from typing import Any

from pydantic.dataclasses import dataclass

from roletrust_env.arrays import Array
from roletrust_env.game.policy import Policy
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random
from roletrust_env.ranges import Share


@dataclass(frozen=True)
class Honest(Policy):
    """Honest play: a provider serves as well as it can, a rater reports what it perceived.

    Attributes:
        best: the quality that the provider can reach, in [0, 1].
    """

    best: Share = 1.0

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Its best, always. See `Policy.quality`."""
        return 0 * view.trust + self.best, memory
