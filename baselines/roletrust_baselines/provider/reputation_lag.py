"""The reputation lag attack."""

from typing import Annotated, Any

from roletrust_baselines.provider.cheating import CheatingProvider
from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@checked_dataclass
class ReputationLag(CheatingProvider):
    """Reputation lag: a provider that cheats until the first bad ratings arrive, and then serves well.

    Kerr and Cohen (2009), "Smart Cheaters Do Prosper": until bad ratings arrive, a provider still sells on its old
    trust. In our interpretation it cheats while it is trusted and the mean of the ratings that arrived in the last
    round is not low, or no ratings arrived. An opportunistic provider stops when its trust falls; this one stops
    earlier.

    Attributes:
        threshold: Own ToP from which on it cheats, in [0, 1].
        noticed: Mean rating below which its bad service is noticed, in [0, 1].
        bad: Quality of bad service, in [0, 1].
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    threshold: Annotated[Share, GridValues(0.5, 0.7, 0.9)] = 0.7
    noticed: Annotated[Share, GridValues(0.5, 0.8)] = 0.5

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether it is trusted and its bad service is not noticed. See `CheatingProvider.cheats`."""
        arrived = cast(view.rated, view.trust.dtype).sum(axis=0)
        total = namespace(view.ratings).where(view.rated, view.ratings, 0 * view.ratings).sum(axis=0)
        return (view.trust >= self.threshold) & ~(total < self.noticed * arrived), memory
