"""The whitewashing attack."""

from typing import Annotated, Any

from pydantic import ConfigDict
from pydantic.dataclasses import dataclass

from roletrust_baselines.identity.cheat import IdentityAttack
from roletrust_env.arrays import Array
from roletrust_env.game.views import IdentityView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@dataclass(frozen=True, config=ConfigDict(arbitrary_types_allowed=True))
class Whitewashing(IdentityAttack):
    """Whitewashing: a cheat that leaves when its trust is low, and comes back as a newcomer.

    After Friedman and Resnick (2001), "The Social Cost of Cheap Pseudonyms". The identity after the one that left comes
    in the next round; also after one that was cut off. The last one stays, however low its trust.

    Attributes:
        reserve: identities in reserve that it takes beside its first: how often it can come back, 1 or more.
        serves: how each of them serves; by default always as badly as can be.
        rates: how each of them rates; by default all as low as can be.
        threshold: trust below which it leaves, in [0, 1]; above a newcomer's trust, it leaves round after round.
    """

    threshold: Annotated[Share, GridValues(0.2, 0.3, 0.4)] = 0.3

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """One identity after the other. See `Policy.presence`."""
        its_turn = (view.turn == 0) | view.succeeds & (view.turn <= self.reserve)
        tainted = view.present & (view.trust < self.threshold) & (view.turn < self.reserve)
        return its_turn & ~tainted, memory
