"""The threshold surfing attack."""

from typing import Annotated, Any, ClassVar

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Lam, SearchRange, Share


@checked_dataclass
class ThresholdSurfing(WindowedAttack):
    """Threshold surfing: a provider that serves just well enough to stay above the trust at which it is cut off.

    This strategy against admission control (`Scenario.admission`) is not from a paper. It predicts its trust as the
    exponential mean of the quality that it delivers. Its last service is not rated yet, so it chooses the quality of
    the next one such that its trust after both is the threshold plus the margin.

    Attributes:
        threshold: Trust below which admission control can cut it off, in [0, 1].
        margin: Distance at which it keeps its trust above the threshold, in [0, 1].
        lam: Weight of the newest round that it assumes for trust, in [0.5, 1).
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    threshold: Share = 0.25
    margin: Annotated[Share, SearchRange(0, 0.5), GridValues(0.0, 0.05, 0.2)] = 0.05
    lam: Lam = 0.5
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the quality that keeps its trust at the target while active, else 1. See `Policy.quality`."""
        xp, zero = namespace(view.trust), 0 * view.trust
        predicted = (1 - self.lam) * view.trust + self.lam * view.quality
        needed = (self.threshold + self.margin - (1 - self.lam) * predicted) / self.lam
        return xp.where(self.active(view.round), xp.clip(needed, 0, 1), zero + 1), memory
