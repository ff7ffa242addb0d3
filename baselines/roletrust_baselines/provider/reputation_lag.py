"""The reputation lag attack."""

from typing import Annotated, Any

from pydantic.dataclasses import dataclass

from roletrust_baselines.provider.cheating import CheatingProvider
from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@dataclass(frozen=True)
class ReputationLag(CheatingProvider):
    """Reputation lag: a provider that cheats until the first ratings of it arrive, and then serves well.

    Kerr and Cohen (2009), "Smart Cheaters Do Prosper": what is sold before the news of bad service spreads is sold on
    the old trust. The reading here: it is trusted, and the mean of the ratings that arrived in the last round tells of
    no bad service, or none arrived. An opportunistic provider waits until its trust falls; this one stops before.

    Attributes:
        threshold: own ToP from which on it cheats, in [0, 1].
        noticed: mean rating below which its bad service is known, in [0, 1].
        bad: quality of bad service, in [0, 1].
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    threshold: Annotated[Share, GridValues(0.5, 0.7, 0.9)] = 0.7
    noticed: Annotated[Share, GridValues(0.5, 0.8)] = 0.5

    def cheats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """While it is trusted and nobody has told. See `CheatingProvider.cheats`."""
        arrived = cast(view.rated, view.trust.dtype).sum(axis=0)
        told = namespace(view.ratings).where(view.rated, view.ratings, 0 * view.ratings).sum(axis=0)
        return (view.trust >= self.threshold) & ~(told < self.noticed * arrived), memory
