"""The collusion attack."""

from typing import Annotated

from pydantic.dataclasses import dataclass

from roletrust_baselines.coalition.self_promotion import SelfPromotion
from roletrust_env.arrays import Array
from roletrust_env.game.views import RaterView
from roletrust_env.ranges import GridValues, Share


@dataclass(frozen=True)
class Collusion(SelfPromotion):
    """Collusion: a ring that praises its own providers, which serve badly, and sinks the rest.

    Ballot stuffing and bad-mouthing by one ring, as in Hoffman, Zage and Nita-Rotaru (2009).

    Attributes:
        accomplices: places of the ring's providers on the provider axis.
        bad: quality of their services, in [0, 1].
        lift: share of what a note of them lacks to 1 that is added, in [0, 1].
        sink: share of a note of the others that is withheld, in [0, 1].
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    sink: Annotated[Share, GridValues(0.5, 1.0)] = 1.0

    def of_others(self, view: RaterView) -> Array:
        """Less than they deserve. See `SelfPromotion.of_others`."""
        return view.service * (1 - self.sink)
