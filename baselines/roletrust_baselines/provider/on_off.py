"""The on-off attack (OOA)."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import PositiveInt
from pydantic.dataclasses import dataclass

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, NotSearched, SearchRange, Share


@dataclass(frozen=True)
class OnOff(WindowedAttack):
    """On-off attack (OOA): a provider that serves badly and well in turn.

    Su and Saint-Jore (EWSN 2023), section 3, Figure 3. With `switching="random"` bad and good spells have geometric
    lengths of the same means as in the regular attack.

    Attributes:
        period: rounds of one bad and one good spell together.
        duty: share of the period that is bad, in [0, 1]; a regular period begins with its bad rounds, rounded up.
        bad: quality of bad service, in [0, 1].
        good: quality of good service while the attack lasts, in [0, 1].
        switching: `"regular"` or `"random"`.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    period: Annotated[PositiveInt, SearchRange(1, 12), GridValues(2, 3, 5, 10)] = 2
    duty: Annotated[Share, GridValues(0.25, 0.5, 0.75)] = 0.5
    bad: Annotated[Share, GridValues(0.0, 0.5)] = 0.0
    good: Annotated[Share, GridValues(1.0)] = 1.0
    switching: Annotated[Literal["regular", "random"], NotSearched()] = "regular"
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality"})

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Whether the service is bad just now, if that is left to chance. See `Policy.begin`."""
        return None if self.switching == "regular" else random.uniform(shape) < self.duty

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Bad or good by turns while active, 1 otherwise. See `Policy.quality`."""
        xp, zero = namespace(view.trust), 0 * view.trust
        bad_rounds = self.duty * self.period
        if self.switching == "regular":
            bad = (view.round - self.start) % self.period < bad_rounds - 1e-9  # 0.07 * 100 is a little above 7
        else:
            bad = memory
            leaves = xp.where(bad, _chance(bad_rounds), _chance(self.period - bad_rounds))
            memory = bad ^ (random.uniform(view.trust.shape) < leaves)
        served = xp.where(bad, zero + self.bad, zero + self.good)
        return xp.where(self.active(view.round), served, zero + 1), memory


def _chance(mean_rounds: float) -> float:
    """The chance, in each round, that a spell of this mean length ends."""
    return 1.0 if mean_rounds <= 1 else 1 / mean_rounds
