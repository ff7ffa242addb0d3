"""Base class of raters that lie together without messages."""

from typing import Annotated, Any, ClassVar, Literal

from roletrust_baselines.agent_indices import AgentIndices, index_mask
from roletrust_baselines.coalition.estimates import Estimates, ranks
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import Accomplices, GridValues


@checked_dataclass
class AgreeingRater(WindowedAttack):
    """Rater of a coalition that lies about each provider by its rank.

    Raters need no messages to agree: all of them see the same published trust, and the means of their perceptions come
    closer to each other with every service.

    They have no noise of their own, also outside the attack: in place of its last perception, a rater reports the mean
    of all its perceptions of a provider. It looks more consistent than an honest rater.

    Attributes:
        by: Value that ranks the providers: `"perceived"` is the rater's mean perception, or published trust before the
            first; `"published"` is published trust.
        accomplices: Indices of the accomplices among the providers. They are always rated 1 and have no rank. None is
            a coalition without accomplices.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    by: Annotated[Literal["perceived", "published"], GridValues("perceived")] = "perceived"
    accomplices: Annotated[AgentIndices | None, Accomplices()] = None
    attacks: ClassVar[frozenset[Channel]] = frozenset({"ratings"})

    def lies(self, estimates: Array, ranks: Array) -> Array:
        """Return its false ratings of all providers, shape (P, ...).

        Args:
            estimates: Mean perceived quality of the providers, shape (P, ...).
            ranks: Their ranks from 0, the best, to 1, shape (P, ...). Ranks of accomplices have no meaning.
        """
        raise NotImplementedError

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return a memory without perceptions. See `Policy.begin`."""
        return Estimates.nothing(random, shape)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return false ratings while active, and its estimates otherwise. See `Policy.ratings`."""
        memory = memory.after(view)
        return self.reports(view, memory, self.active(view.round)), memory

    def reports(self, view: RaterView, estimates: Estimates, lying: Array) -> Array:
        """Return false ratings where the rater lies, and its estimates elsewhere.

        Args:
            view: View of the rater.
            estimates: Estimates after the services of this round.
            lying: Whether the rater lies, boolean, shape (...).
        """
        means = estimates.means(view.published)
        mine = None if self.accomplices is None else index_mask(self.accomplices, means, "accomplices")
        xp = namespace(means)
        lies = self.lies(means, ranks(means if self.by == "perceived" else view.published, mine))
        if mine is not None:
            lies = xp.where(mine, 0 * means + 1, lies)
        return xp.where(lying, lies, means)
