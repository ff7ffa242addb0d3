"""The milking ring."""

from typing import Annotated, Any

from pydantic import NonNegativeInt

from roletrust_baselines.coalition.cheating_ring import CheatingRing
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange, Share


@checked_dataclass
class MilkingRing(CheatingRing):
    """Milking ring: a cheating ring whose providers cheat while their trust is near the highest that they have had.

    A cheating ring has to know how high trust rises under a trust model. This ring finds it out: its threshold is a
    share of the highest trust so far. This variant is not from a paper.

    Attributes:
        patience: Number of rounds in which its providers build up trust, while its raters already lie.
        threshold: Share of the highest own ToP so far from which on a provider cheats, in [0, 1].
        bad: Quality of bad service, in [0, 1].
        cut: Rank down to which other providers are sunk, from 0, the best one only, to 1, all of them.
        sink: Share by which their ratings are reduced, in [0, 1].
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or published trust before the
            first; `"published"` is published trust.
        accomplices: Indices of the ring's providers among all providers. They are always rated 1 and have no rank.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    patience: Annotated[NonNegativeInt, SearchRange(0, 20), GridValues(3, 10)] = 3
    threshold: Annotated[Share, GridValues(0.85, 0.95)] = 0.85
    cut: Annotated[Share, GridValues(0.2, 0.4)] = 0.3

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return a memory without perceptions and trust. See `Policy.begin`."""
        estimates = super().begin(random, shape)
        return estimates, estimates.total[0]

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad quality while active and near its highest trust, and 1 otherwise. See `Policy.quality`."""
        highest = namespace(view.trust).maximum(memory[1], view.trust)
        trusted = (view.trust >= self.threshold * highest) & (view.round >= self.start + self.patience)
        return self.service(view, trusted), (memory[0], highest)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return praise of the ring and lies about the best others while active. See `AgreeingRater.ratings`."""
        ratings, estimates = super().ratings(view, memory[0], random)
        return ratings, (estimates, memory[1])
