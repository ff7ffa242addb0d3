"""Silence: ratings that are never sent."""

from typing import Annotated, Any, ClassVar

from pydantic.dataclasses import dataclass

from roletrust_baselines.agent_indices import AgentIndices, index_mask
from roletrust_env.arrays import Array
from roletrust_env.game.policy import Channel
from roletrust_env.game.schedule import WindowedAttack
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import Victims


@dataclass(frozen=True)
class Silent(WindowedAttack):
    """Silence: a rater that is served as all are and rates nobody, or leaves out those that it wants to stay unknown.

    A reputation system collects, distributes and aggregates feedback (Resnick et al. 2000, "Reputation Systems"): of
    what is never sent it learns nothing. To attack by that, also about chosen providers only, is from no paper.

    Attributes:
        targets: places of the providers that it does not rate; None rates nobody.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    targets: Annotated[AgentIndices | None, Victims()] = None
    attacks: ClassVar[frozenset[Channel]] = frozenset({"silence"})

    def withholds(self, view: RaterView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """All it owes, or what it owes the targets, while active. See `Policy.withholds`."""
        owed = view.awaiting & self.active(view.round)
        return owed if self.targets is None else owed & index_mask(self.targets, view.service, "targets"), memory
