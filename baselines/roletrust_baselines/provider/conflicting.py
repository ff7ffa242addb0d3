"""The conflicting behaviour attack."""

from typing import Annotated, Any, ClassVar

from roletrust_baselines.agent_indices import AgentIndices, index_mask
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import ProviderView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, Share


@checked_dataclass
class Conflicting(WindowedAttack):
    """Conflicting behaviour: a provider that serves chosen raters badly and all others well.

    Sun, Han and Liu (2008), "Defense of Trust Management Vulnerabilities in Distributed Networks": the ratings of
    honest raters contradict each other, so that honest raters look like liars to one another. Dellarocas (2000)
    describes the same behaviour of sellers as discrimination against buyers. The number of raters that are served badly
    is not specified there.

    Attributes:
        raters: Indices of the raters that it serves badly; None is the first half of all raters, rounded up.
        bad: Quality for these raters as a share of the quality for the others, in [0, 1].
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    raters: AgentIndices | None = None
    bad: Annotated[Share, GridValues(0.0, 0.5)] = 0.0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"treatment"})

    def treats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """Return the share of quality for each rater: bad for the chosen ones while active. See `Policy.treats`."""
        half = tuple(range((len(view.ratings) + 1) // 2))
        chosen = half if self.raters is None else self.raters
        return treatment(view, chosen, self.bad, self.active(view.round)), memory


def treatment(view: ProviderView, raters: tuple[int, ...], bad: float, active: Array) -> Array:
    """Return the share of quality for each rater, shape (S, ...): `bad` for some while the attack is active, else 1.

    Args:
        view: View of the provider.
        raters: Indices of the raters that it serves badly.
        bad: Quality for these raters as a share of the quality for the others.
        active: Whether the attack is active, boolean.
    """
    zero = 0 * view.ratings
    badly = index_mask(raters, zero, "raters", axis="rater") & active
    return namespace(zero).where(badly, zero + bad, zero + 1)
