"""The on-off attack (OOA)."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import PositiveInt

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, NotSearched, SearchRange, Share


@checked_dataclass
class OnOff(WindowedAttack):
    """On-off attack (OOA): a provider that serves badly and well in turn.

    Su and Saint-Jore (EWSN 2023), section 3, Figure 3. With `switching="random"` the phases of bad and of good service
    have geometrically distributed lengths, with the same means as in the regular attack.

    Attributes:
        period: Number of rounds of a bad and a good phase together.
        duty: Share of the period with bad service, in [0, 1]. A regular period begins with its bad rounds, rounded up.
        bad: Quality of bad service, in [0, 1].
        good: Quality of good service during the attack, in [0, 1].
        switching: Switching between the phases, `"regular"` or `"random"`.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    period: Annotated[PositiveInt, SearchRange(1, 12), GridValues(2, 3, 5, 10)] = 2
    duty: Annotated[Share, GridValues(0.25, 0.5, 0.75)] = 0.5
    bad: Annotated[Share, GridValues(0.0, 0.5)] = 0.0
    good: Annotated[Share, GridValues(1.0)] = 1.0
    switching: Annotated[Literal["regular", "random"], NotSearched()] = "regular"
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality"})

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return whether the first phase is bad, if the switching is random. See `Policy.begin`."""
        return None if self.switching == "regular" else random.uniform(shape) < self.duty

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad and good quality in turn while active, and 1 otherwise. See `Policy.quality`."""
        xp, zero = namespace(view.trust), 0 * view.trust
        bad_rounds = self.duty * self.period
        if self.switching == "regular":
            bad = (view.round - self.start) % self.period < bad_rounds - 1e-9  # as 0.07 * 100 is slightly above 7
        else:
            bad = memory
            switches = xp.where(bad, _switch_probability(bad_rounds), _switch_probability(self.period - bad_rounds))
            memory = bad ^ (random.uniform(view.trust.shape) < switches)
        quality = xp.where(bad, zero + self.bad, zero + self.good)
        return xp.where(self.active(view.round), quality, zero + 1), memory


def _switch_probability(mean_rounds: float) -> float:
    """Return the probability per round that a phase of this mean length ends."""
    return 1.0 if mean_rounds <= 1 else 1 / mean_rounds
