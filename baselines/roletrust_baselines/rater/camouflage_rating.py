"""The camouflage attack by ratings."""

from typing import Annotated, Any

from pydantic import NonNegativeInt

from roletrust_baselines.rater.bad_mouthing import BadMouthing
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.schedule import asleep, wake
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange, Share


@checked_dataclass
class CamouflageRating(BadMouthing):
    """Camouflage: a sleeper, which is a rater that is honest until it is trusted, and bad-mouths from then on.

    Irissappane, Jiang and Zhang (2012), "Towards a Comprehensive Testbed to Evaluate the Robustness of Reputation
    Systems against Unfair Rating Attacks". With `wakes_at=0` it depends on the round only, like
    `BadMouthing(start=...)`.

    Attributes:
        wakes_at: Own ToR from which on it lies, permanently, in [0, 1].
        lie: Kind of lie: `"constant"` always rates `level`; `"relative"` rates (1 - level) * perceived quality.
        level: Rating of the constant lie, or share by which the relative lie reduces a rating; in [0, 1].
        targets: Indices of the victims among the providers; None lies about all of them.
        start: First round in which it can lie.
        stop: First round after the attack; None attacks to the end.
    """

    start: Annotated[NonNegativeInt, SearchRange(0, 100), GridValues(0, 20, 50)] = 20
    wakes_at: Annotated[Share, GridValues(0.0, 0.9)] = 0.8

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return that it is asleep. See `Policy.begin`."""
        return asleep(random, shape)

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the lies of `BadMouthing` once it is awake, and honest ratings before. See `LyingRater.lies`."""
        lies, _ = super().lies(view, None, random)
        awake, memory = wake(self.active(view.round) & (view.trust >= self.wakes_at), memory)
        return namespace(lies).where(awake, lies, view.service), memory
