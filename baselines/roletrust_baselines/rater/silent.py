"""The silence attack."""

from typing import Annotated, Any, ClassVar

from roletrust_baselines.agent_indices import AgentIndices, provider_mask
from roletrust_env.arrays import Array
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import Victims


@checked_dataclass
class Silent(WindowedAttack):
    """Silence: a rater that uses services but withholds its ratings, of all providers or of chosen ones.

    A reputation system collects, distributes and aggregates feedback (Resnick et al. 2000, "Reputation Systems"), so it
    learns nothing from ratings that are not sent. Silence as an attack is not from a paper.

    Attributes:
        targets: Indices of the providers that it does not rate; None rates no provider.
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    targets: Annotated[AgentIndices | None, Victims()] = None
    attacks: ClassVar[frozenset[Channel]] = frozenset({"silence"})

    def withholds(self, view: RaterView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """Return a mask of the ratings that it withholds while active: all, or the targets. See `Policy.withholds`."""
        due = view.awaiting & self.active(view.round)
        return due if self.targets is None else due & provider_mask(self.targets, view, "targets"), memory
