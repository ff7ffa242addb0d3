"""The common part of central models: one formula for ratings on a grid and on edges."""

from abc import ABC, abstractmethod
from typing import Any

from roletrust_env.arrays import Array
from roletrust_env.trust.ratings import MaskedRatings, Ratings


class Central(ABC):
    """A trust model whose formula is written with the operations of `Ratings`, so that it runs on grids and on edges.

    The fields of its state say which agents or pairs they are about: `PerRater`, `PerProvider`, `PerPair`, `PairAge`.

    Attributes:
        local: Whether a round changes only agents and pairs with ratings in it, and takes nothing from others. Then a
            log of many agents is played in the time that its ratings take.
    """

    local = False

    @abstractmethod
    def after_round(self, state: Any, ratings: Ratings) -> Any:
        """Return the state after one more round.

        Args:
            state: State before the round, which must not be changed.
            ratings: Ratings of the round, on a grid or on edges.
        """

    def update(self, state: Any, ratings: Array, mask: Array | None) -> Any:
        """Return the state after one round of ratings on a grid. See `TrustModel.update`."""
        return self.after_round(state, MaskedRatings.of(ratings, mask))

    @abstractmethod
    def rater_trust(self, state: Any) -> Array:
        """Return the trust of each rater. See `TrustModel.rater_trust`."""

    @abstractmethod
    def provider_trust(self, state: Any) -> Array:
        """Return the trust of each provider. See `TrustModel.provider_trust`."""
