"""Base classes of attacks by ratings: a time window, and the providers that they lie about."""

from dataclasses import field
from typing import Annotated, Any, ClassVar

from roletrust_baselines.agent_indices import AgentIndices, provider_mask
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import Victims


@checked_dataclass
class LyingRater(WindowedAttack):
    """Rater that lies about all providers in a time window.

    Attributes:
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    attacks: ClassVar[frozenset[Channel]] = frozenset({"ratings"})

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return its false ratings of all providers, shape (P, ...), and its new memory."""
        raise NotImplementedError

    def about(self, view: RaterView) -> Array:
        """Return a mask of the providers that it lies about in this round, boolean, shape (P, ...) or (...)."""
        return self.active(view.round)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return false ratings while active, and honest ratings otherwise. See `Policy.ratings`."""
        lies, memory = self.lies(view, memory, random)
        return namespace(lies).where(self.about(view), lies, view.service), memory


@checked_dataclass
class TargetedLyingRater(LyingRater):
    """Rater that lies about chosen providers and is honest about the others.

    With targets, such an attack is discriminatory (Dellarocas 2000). Discrimination by providers is to serve chosen
    raters badly, see `Conflicting`.

    Attributes:
        targets: Indices of the victims among the providers; None lies about all of them.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    targets: Annotated[AgentIndices | None, Victims()] = field(default=None, kw_only=True)

    def about(self, view: RaterView) -> Array:
        """Return a mask of the targets while active. See `LyingRater.about`."""
        active = self.active(view.round)
        return active if self.targets is None else active & provider_mask(self.targets, view, "targets")
