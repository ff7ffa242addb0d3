"""Attacks that serve by one policy and rate by another."""

from typing import Any

from roletrust_env.arrays import Array
from roletrust_env.game.policy import Policy
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.randomness import Random


class ByChannel(Policy):
    """A policy that serves by one policy and rates by another.

    Attributes:
        serves: Policy for services.
        rates: Policy for ratings.
    """

    serves: Policy
    rates: Policy

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return the memories of the two policies. See `Policy.begin`."""
        return self.serves.begin(random, shape), self.rates.begin(random, shape)

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.quality`."""
        quality, mine = self.serves.quality(view, memory[0], random)
        return quality, (mine, memory[1])

    def treats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """See `Policy.treats`."""
        treatment, mine = self.serves.treats(view, memory[0], random)
        return treatment, (mine, memory[1])

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.ratings`."""
        ratings, mine = self.rates.ratings(view, memory[1], random)
        return ratings, (memory[0], mine)

    def withholds(self, view: RaterView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """See `Policy.withholds`."""
        withheld, mine = self.rates.withholds(view, memory[1], random)
        return withheld, (memory[0], mine)
