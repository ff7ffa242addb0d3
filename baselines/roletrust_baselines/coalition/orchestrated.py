"""The orchestrated attack."""

from typing import Annotated, Any

from pydantic import NonNegativeInt, PositiveInt

from roletrust_baselines.coalition.collusion import Collusion
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.ranges import GridValues, SearchRange


@checked_dataclass
class Orchestrated(Collusion):
    """Orchestrated attack: a ring of teams that attack in turn, while the other teams repair their trust.

    This is the oscillation attack of Hoffman, Zage and Nita-Rotaru (2009). The team in turn colludes. The other teams
    serve well and rate outsiders honestly, but still praise the providers of the ring. Each agent has the number of its
    team as a parameter.

    Attributes:
        teams: Number of teams.
        team: Number of the agent's team, from 0 on.
        turn: Number of rounds for which a team attacks.
        accomplices: Indices of the providers of the ring among all providers.
        bad: Quality of service of the attacking team, in [0, 1].
        lift: Share of the distance to 1 that is added to a rating of the ring's providers, in [0, 1].
        sink: Share by which the attacking team reduces a rating of the other providers, in [0, 1].
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    teams: PositiveInt = 2
    team: Annotated[NonNegativeInt, SearchRange(0, 1), GridValues(0)] = 0
    turn: Annotated[PositiveInt, SearchRange(1, 12), GridValues(2, 5)] = 5

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return bad quality while its team attacks, and 1 otherwise. See `Policy.quality`."""
        bad, memory = super().quality(view, memory, random)
        return namespace(bad).where(self._in_turn(view.round), bad, 0 * bad + 1), memory

    def of_others(self, view: RaterView) -> Array:
        """Return reduced ratings while its team attacks, and honest ratings otherwise."""
        reduced = super().of_others(view)
        return namespace(reduced).where(self._in_turn(view.round), reduced, view.service)

    def _in_turn(self, round: Array) -> Array:
        return ((round - self.start) // self.turn) % self.teams == self.team % self.teams
