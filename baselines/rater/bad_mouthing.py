"""The bad-mouthing attack (BMA)."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, NonNegativeInt
from pydantic.dataclasses import dataclass

from baselines.window import WindowedAttack
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import Share


@dataclass(frozen=True)
class BadMouthing(WindowedAttack):
    """Bad-mouthing attack (BMA): a rater that rates good services low.

    Su and Saint-Jore (EWSN 2023), section 3, Figure 4: the constant note 0.5.

    Attributes:
        lie: `"constant"` rates `level` whatever it receives; `"relative"` rates (1 - level) * what it perceived.
        level: of the constant lie, the note; of the relative lie, the share of the note that is withheld; in [0, 1].
        targets: places of the victims on the provider axis; None lies about all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    lie: Literal["constant", "relative"] = "constant"
    level: Share = 0.5
    targets: Annotated[tuple[NonNegativeInt, ...], Field(min_length=1)] | None = None
    attacks: ClassVar[frozenset[Channel]] = frozenset({"ratings"})

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Lies about the targets while active, the truth otherwise. See `Policy.ratings`."""
        xp, service = namespace(view.service), view.service
        lie = service * (1 - self.level) if self.lie == "relative" else 0 * service + self.level
        lies = self.active(view.round)
        if self.targets is not None:
            if max(self.targets) >= service.shape[0]:
                raise ValueError(f"targets is {self.targets}; the last provider is {service.shape[0] - 1}")
            victim = xp.stack([lies & (j in self.targets) for j in range(service.shape[0])])
            return xp.where(victim, lie, service), memory
        return xp.where(lies, lie, service), memory
