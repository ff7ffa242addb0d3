"""Honest play."""

from dataclasses import dataclass
from typing import Any

from roletrust_env.arrays import Array
from roletrust_env.policy import Policy
from roletrust_env.randomness import Random
from roletrust_env.views import ProviderView


@dataclass(frozen=True)
class Honest(Policy):
    """Honest play: a provider serves as well as it can, a rater reports what it perceived.

    Attributes:
        best: the quality that the provider can reach, in [0, 1].
    """

    best: float = 1.0

    def __post_init__(self) -> None:
        if not 0 <= self.best <= 1:
            raise ValueError(f"best is {self.best!r}; a quality must lie in [0, 1]")

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Its best, always. See `Policy.quality`."""
        return 0 * view.trust + self.best, memory
