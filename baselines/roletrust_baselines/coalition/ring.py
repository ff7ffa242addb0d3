"""Base class of rings of raters and providers."""

from typing import Annotated, Any, ClassVar

from roletrust_baselines.coalition.agreement import AgreeingRater
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@checked_dataclass
class Ring(AgreeingRater):
    """Ring whose providers cheat above a threshold of trust, while its raters lift them and sink the best others.

    Attributes:
        threshold: Own ToP from which on a provider cheats, in [0, 1].
        bad: Quality of bad service, in [0, 1].
        cut: Rank down to which other providers are sunk, from 0, the best one only, to 1, all of them.
        sink: Share by which their ratings are reduced, in [0, 1].
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or published trust before the
            first; `"published"` is published trust.
        accomplices: Indices of the ring's providers among all providers. They are always rated 1 and have no rank.
            None is a ring without providers.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    threshold: Annotated[Share, GridValues(0.5, 0.7)] = 0.7
    bad: Annotated[Share, GridValues(0.0)] = 0.0
    cut: Annotated[Share, GridValues(0.2, 0.4, 0.7)] = 0.4
    sink: Annotated[Share, GridValues(1.0)] = 1.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad quality while active and trusted, and 1 otherwise. See `Policy.quality`."""
        return self.service(view, view.trust >= self.threshold), memory

    def service(self, view: ProviderView, trusted: Array) -> Array:
        """Return bad quality where the ring is active and the provider is trusted, and 1 elsewhere, shape (...)."""
        zero = 0 * view.trust
        return namespace(zero).where(self.active(view.round) & trusted, zero + self.bad, zero + 1)

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return reduced ratings of the best providers, and honest ones of the rest. See `AgreeingRater.lies`."""
        return namespace(ranks).where(ranks <= self.cut, estimates * (1 - self.sink), estimates)
