"""The threshold surfing attack."""

from typing import Annotated, Any, ClassVar

from pydantic.dataclasses import dataclass

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Lam, SearchRange, Share


@dataclass(frozen=True)
class ThresholdSurfing(WindowedAttack):
    """Threshold surfing: a provider that serves just well enough to stay above the trust at which it is cut off.

    A strategy against admission control (`Scenario.admission`); its formula is from no paper. It foresees its trust as
    if that were the smoothed mean of what it delivers: one service of its own is not rated yet, and the next one has to
    bring its trust to the threshold and the margin.

    Attributes:
        threshold: trust under which an agent is in danger, in [0, 1].
        margin: how far above it keeps its trust, in [0, 1].
        lam: weight of the newest round that it believes trust to have, in [0.5, 1).
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    threshold: Share = 0.25
    margin: Annotated[Share, SearchRange(0, 0.5), GridValues(0.0, 0.05, 0.2)] = 0.05
    lam: Lam = 0.5
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """What brings its trust to the mark while active, 1 otherwise. See `Policy.quality`."""
        xp, zero = namespace(view.trust), 0 * view.trust
        foreseen = (1 - self.lam) * view.trust + self.lam * view.quality
        needed = (self.threshold + self.margin - (1 - self.lam) * foreseen) / self.lam
        return xp.where(self.active(view.round), xp.clip(needed, 0, 1), zero + 1), memory
