"""The orchestrated attack."""

from typing import Annotated, Any

from pydantic import NonNegativeInt, PositiveInt
from pydantic.dataclasses import dataclass

from roletrust_baselines.coalition.collusion import Collusion
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange


@dataclass(frozen=True)
class Orchestrated(Collusion):
    """Orchestrated attack: a ring of teams of which one attacks at a time, while the others repair their trust.

    The oscillation attack of Hoffman, Zage and Nita-Rotaru (2009): the team whose turn it is colludes; the others serve
    well and are fair to strangers, but go on praising the ring's providers. Give each team's agents its number.

    Attributes:
        teams: number of teams.
        team: number of the agent's own, from 0 on.
        turn: rounds for which a team attacks.
        accomplices: places of the ring's providers on the provider axis.
        bad: quality of the services of who attacks, in [0, 1].
        lift: share of what a note of them lacks to 1 that is added, in [0, 1].
        sink: share of a note of the others that is withheld by who attacks, in [0, 1].
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    teams: PositiveInt = 2
    team: Annotated[NonNegativeInt, SearchRange(0, 1), GridValues(0)] = 0
    turn: Annotated[PositiveInt, SearchRange(1, 12), GridValues(2, 5)] = 5

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Bad while it is its team's turn, 1 otherwise. See `Policy.quality`."""
        bad, memory = super().quality(view, memory, random)
        return namespace(bad).where(self._in_turn(view.round), bad, 0 * bad + 1), memory

    def of_others(self, view: RaterView) -> Array:
        """Less than they deserve while it is its team's turn, and what they deserve otherwise."""
        sunk = super().of_others(view)
        return namespace(sunk).where(self._in_turn(view.round), sunk, view.service)

    def _in_turn(self, round: Array) -> Array:
        return ((round - self.start) // self.turn) % self.teams == self.team % self.teams
