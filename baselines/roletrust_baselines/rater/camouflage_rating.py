"""The camouflage attack by ratings."""

from typing import Annotated, Any

from pydantic import NonNegativeInt
from pydantic.dataclasses import dataclass

from roletrust_baselines.rater.bad_mouthing import BadMouthing
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.schedule import wake
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import Searched, Share, Tried


@dataclass(frozen=True)
class CamouflageRating(BadMouthing):
    """Camouflage: a rater that is fair until it is trusted, and bad-mouths from then on; a sleeper.

    Irissappane, Jiang and Zhang (2012), "Towards a Comprehensive Testbed to Evaluate the Robustness of Reputation
    Systems against Unfair Rating Attacks". With `wakes_at=0` it wakes by the clock alone, as `BadMouthing(start=...)`.

    Attributes:
        wakes_at: own ToR at which it starts to lie, for good, in [0, 1].
        lie: `"constant"` rates `level` whatever it receives; `"relative"` rates (1 - level) * what it perceived.
        level: see `BadMouthing`.
        targets: places of the victims on the provider axis; None lies about all.
        start: round up to which it is fair in any case.
        stop: first round after the attack; None attacks to the end.
    """

    start: Annotated[NonNegativeInt, Searched(0, 100), Tried(0, 20, 50)] = 20
    wakes_at: Annotated[Share, Tried(0.0, 0.9)] = 0.8

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """The truth while it sleeps. See `Lying.lies`."""
        lies, _ = super().lies(view, None, random)
        awake, memory = wake(self.active(view.round) & (view.trust >= self.wakes_at), memory)
        return namespace(lies).where(awake, lies, view.service), memory
