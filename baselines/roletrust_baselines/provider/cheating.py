"""Base class of attacks by services: a time window, and the quality of bad service."""

from typing import Any, ClassVar

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import Share


@checked_dataclass
class CheatingProvider(WindowedAttack):
    """Provider that serves as well as it can, except in the rounds in which it cheats.

    Attributes:
        bad: Quality of bad service, in [0, 1].
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    bad: Share = 0.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality"})

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether it would cheat in this round, boolean, shape (...), and its new memory."""
        raise NotImplementedError

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad quality in the active rounds in which it cheats, and 1 otherwise. See `Policy.quality`."""
        zero = 0 * view.trust
        cheats, memory = self.cheats(view, memory, random)
        return namespace(zero).where(cheats & self.active(view.round), zero + self.bad, zero + 1), memory
