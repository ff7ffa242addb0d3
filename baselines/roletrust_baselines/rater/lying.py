"""What attacks by ratings share: a window of time, and whom they lie about."""

from dataclasses import field
from typing import Annotated, Any, ClassVar

from pydantic.dataclasses import dataclass

from roletrust_baselines.agent_indices import AgentIndices, index_mask
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import Victims


@dataclass(frozen=True)
class LyingRater(WindowedAttack):
    """A rater that lies for a while, about all providers.

    Attributes:
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    attacks: ClassVar[frozenset[Channel]] = frozenset({"ratings"})

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """What it would rate everybody, shape (P, ...), and its new memory."""
        raise NotImplementedError

    def about(self, view: RaterView) -> Array:
        """About whom it lies now, boolean, (P, ...) or (...)."""
        return self.active(view.round)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Lies while active, the truth otherwise. See `Policy.ratings`."""
        lies, memory = self.lies(view, memory, random)
        return namespace(lies).where(self.about(view), lies, view.service), memory


@dataclass(frozen=True)
class TargetedLyingRater(LyingRater):
    """A rater that lies about chosen providers and tells the truth about the others.

    So each of these attacks is discriminatory (Dellarocas 2000) by its targets. The other side of discrimination is to
    serve chosen raters badly, see `Conflicting`.

    Attributes:
        targets: places of the victims on the provider axis; None lies about all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    targets: Annotated[AgentIndices | None, Victims()] = field(default=None, kw_only=True)

    def about(self, view: RaterView) -> Array:
        """The targets, while active. See `LyingRater.about`."""
        active = self.active(view.round)
        return active if self.targets is None else active & index_mask(self.targets, view.service, "targets")
