"""The conflicting behaviour attack."""

from typing import Annotated, Any, ClassVar

from pydantic.dataclasses import dataclass

from roletrust_baselines.agent_indices import AgentIndices, index_mask
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@dataclass(frozen=True)
class Conflicting(WindowedAttack):
    """Conflicting behaviour: a provider that serves chosen raters badly and all others well.

    Sun, Han and Liu (2008), "Defense of Trust Management Vulnerabilities in Distributed Networks": honest raters tell
    of it what contradicts each other, so that they look like liars to one another. Dellarocas (2000) has the same from
    the seller's side, as discrimination against buyers. How many are served badly is left open there.

    Attributes:
        raters: places on the rater axis of those whom it serves badly; None are the first half, rounded up.
        bad: quality of service for them, as a share of the others', in [0, 1].
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    raters: AgentIndices | None = None
    bad: Annotated[Share, GridValues(0.0, 0.5)] = 0.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"treatment"})

    def treats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """Badly the chosen ones while active. See `Policy.treats`."""
        zero = 0 * view.ratings
        chosen = tuple(range((len(zero) + 1) // 2)) if self.raters is None else self.raters
        badly = index_mask(chosen, zero, "raters", axis="rater") & self.active(view.round)
        return namespace(zero).where(badly, zero + self.bad, zero + 1), memory
