"""What attacks by services share: a window of time, and what bad service is."""

from typing import Any, ClassVar

from pydantic.dataclasses import dataclass

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random
from roletrust_env.ranges import Share


@dataclass(frozen=True)
class CheatingProvider(WindowedAttack):
    """A provider that serves as well as it can, but for the rounds in which it cheats.

    Attributes:
        bad: quality of bad service, in [0, 1].
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    bad: Share = 0.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality"})

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Whether it would cheat now, boolean, (...), and its new memory."""
        raise NotImplementedError

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Bad where it cheats while active, 1 otherwise. See `Policy.quality`."""
        zero = 0 * view.trust
        cheats, memory = self.cheats(view, memory, random)
        return namespace(zero).where(cheats & self.active(view.round), zero + self.bad, zero + 1), memory
