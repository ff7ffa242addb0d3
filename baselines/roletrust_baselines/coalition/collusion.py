"""The collusion attack."""

from typing import Annotated

from roletrust_baselines.coalition.self_promotion import SelfPromotion
from roletrust_env.arrays import Array
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import GridValues, Share


@checked_dataclass
class Collusion(SelfPromotion):
    """Collusion: a ring whose providers serve badly, and whose raters praise them and bad-mouth all others.

    The ring combines ballot stuffing and bad-mouthing, as in Hoffman, Zage and Nita-Rotaru (2009).

    Attributes:
        accomplices: Indices of the providers of the ring among all providers.
        bad: Quality of their services, in [0, 1].
        lift: Share of the distance to 1 that is added to a rating of the ring's providers, in [0, 1].
        sink: Share by which a rating of the other providers is reduced, in [0, 1].
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    sink: Annotated[Share, GridValues(0.5, 1.0)] = 1.0

    def of_others(self, view: RaterView) -> Array:
        """Return reduced ratings of the other providers. See `SelfPromotion.of_others`."""
        return view.service * (1 - self.sink)
