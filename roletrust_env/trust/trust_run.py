"""A trust model, its state and the rounds so far: what every run of a model can do."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from roletrust_env.shapes import Shape
from roletrust_env.trees import check_ranges
from roletrust_env.trust.key_index import Floats
from roletrust_env.trust.ratings import EdgeFloats, EdgeInts


class TrustRun(ABC):
    """A trust model, its state and the rounds so far.

    Attributes:
        model: Trust model.
        rounds: Number of rounds so far.
        shape: Number of raters S and of providers P.
    """

    model: Any
    rounds: int

    @property
    @abstractmethod
    def shape(self) -> tuple[int, int]:
        """The number of raters and of providers."""

    @property
    @abstractmethod
    def rater_trust(self) -> Annotated[Floats, Shape("S")]:
        """The trust of each rater, shape (S,), in [0, 1]."""

    @property
    @abstractmethod
    def provider_trust(self) -> Annotated[Floats, Shape("P")]:
        """The trust of each provider, shape (P,), in [0, 1]."""

    @abstractmethod
    def play(
        self,
        raters: EdgeInts,
        providers: EdgeInts,
        values: EdgeFloats,
    ) -> None:
        """Play one round. Agents with a place beyond all earlier ones join; ratings of one pair
        count as their mean.

        Args:
            raters: Place of the rater of each rating, shape (E,), at least 0.
            providers: Place of the provider of each rating, shape (E,), at least 0.
            values: Ratings, shape (E,), in [0, 1].
        """

    def skip(self, rounds: int) -> None:
        """Play so many rounds without ratings."""
        for _ in range(rounds):
            self.play(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))

    @abstractmethod
    def join(self, raters: int, providers: int) -> None:
        """Make room for so many raters and providers; new ones have the initial trust."""

    @abstractmethod
    def save(self) -> dict[str, npt.NDArray[Any]]:
        """Return all that the run keeps, by name, for `load`."""

    @abstractmethod
    def load(self, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from what another run of the same model has kept; nothing else may be among the
        arrays.

        Raises:
            ValueError: The arrays do not fit together, or are not what a run can have.
        """

    def _check_loaded(self, state: Any, left: Mapping[str, Any]) -> None:
        """Refuse arrays that are of no part of a state, a state that no rounds lead to, and trust
        outside [0, 1].

        Raises:
            ValueError: There are such arrays, or there is such a state or trust.
        """
        if left:
            raise ValueError(f"{', '.join(left)} is of no part of a state of {self.model!r}")
        check_ranges(state, self.rounds)
        for trust in (self.rater_trust, self.provider_trust):
            if not ((trust >= 0) & (trust <= 1)).all():
                raise ValueError("there is trust outside [0, 1]")
