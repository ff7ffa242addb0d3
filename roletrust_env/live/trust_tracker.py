"""The trust of a team after the rounds so far, under any trust model."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from roletrust_env.live.state_growth import grown_state
from roletrust_env.trees import leaves, map_leaves
from roletrust_env.trust import TrustModel, agent_trust, check_trust_model
from roletrust_env.trust.model import start_model
from roletrust_env.trust.model_checks import watched_update
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario

RoundRatings = Mapping[str, Sequence[float | None]]
"""The ratings of a round: for each rater, one entry per provider in the team's order. None means no rating."""


@dataclass(frozen=True)
class Team:
    """The agents of a team, in the order of the array axes. An agent with both roles is on both axes.

    Attributes:
        raters: Names of the raters, in the order of axis 0.
        providers: Names of the providers, in the order of axis 1.
    """

    raters: tuple[str, ...] = ()
    providers: tuple[str, ...] = ()

    @classmethod
    def of(cls, scenario: Scenario) -> "Team":
        """Return the team of a scenario."""
        roster = Roster.of(scenario)
        return cls(roster.rater_names, roster.provider_names)

    def with_newcomers(self, raters: Iterable[str], providers: Iterable[str]) -> "Team":
        """Return the team with new agents appended."""
        return Team(tuple(dict.fromkeys((*self.raters, *raters))), tuple(dict.fromkeys((*self.providers, *providers))))

    @property
    def peers(self) -> NDArray[np.bool_]:
        """Mask of the pairs in which rater and provider are the same agent, shape (S, P)."""
        return np.array([[rater == provider for provider in self.providers] for rater in self.raters], bool)

    @property
    def dual_role(self) -> tuple[str, ...]:
        """Names of the agents with both roles, in the order of the raters."""
        return tuple(name for name in self.raters if name in self.providers)


class Trust(NamedTuple):
    """The trust values of a team.

    Attributes:
        tor: Trust of each rater.
        top: Trust of each provider.
        toa: Trust of each agent with both roles.
    """

    tor: tuple[float, ...]
    top: tuple[float, ...]
    toa: tuple[float, ...]


class TrustTracker:
    """Tracks the trust of a team from round to round. Its values equal those of a game with the same masks.

    Args:
        model: Trust model, see `TrustModel`.
        team: One or more raters and providers.
        past: Ratings of the rounds so far. An agent that is missing there counts as present, but without ratings given
            or received.

    Raises:
        ValueError: The model is not sound, see `check_trust_model` and `watched_update`.
    """

    def __init__(self, model: TrustModel[Any], team: Team, past: Iterable[RoundRatings] = ()) -> None:
        like = np.zeros((len(team.raters), len(team.providers)))
        check_trust_model(model, team.peers, np.zeros(()))
        self.team, self._model = team, model
        self._state = start_model(model, like, team.peers)
        self._initial = getattr(model, "initial", 0.5)
        self._round = np.zeros((), int)
        self._rated, self._provided = np.zeros(like.shape[0]), np.zeros(like.shape[1])
        for ratings in past:
            self.update(ratings)

    def grow(self, team: Team) -> None:
        """Add newcomers; see `grows` for the models that can.

        Args:
            team: Team with the same agents first.
        """
        self._state = grown_state(self._model, self._state, team.peers)
        self._rated = np.pad(self._rated, (0, len(team.raters) - len(self._rated)))
        self._provided = np.pad(self._provided, (0, len(team.providers) - len(self._provided)))
        self.team = team

    @property
    def memory(self) -> list[Any]:
        """Arrays and numbers from which `remember` makes the same tracker again."""
        return [int(self._round), self._rated, self._provided, *leaves(self._state)]

    def remember(self, memory: Sequence[Any]) -> None:
        """Continue where another tracker of the same model and team was.

        Args:
            memory: Memory of the other tracker.

        Raises:
            ValueError: The memory is of another model or team.
        """
        own = self.memory
        if [_form(one) for one in own] != [_form(one) for one in memory]:
            raise ValueError("the memory is of another trust model or of another team")
        number, self._rated, self._provided, *state = memory
        values = iter(state)
        self._round, self._state = np.asarray(number), map_leaves(lambda _: next(values), self._state)

    def update(self, ratings: RoundRatings) -> None:
        """Update trust with the ratings of one round."""
        values = np.full((len(self._rated), len(self._provided)), np.nan)
        for name, row in ratings.items():
            values[self.team.raters.index(name), : len(row)] = [np.nan if rating is None else rating for rating in row]
        mask = ~np.isnan(values)
        values[~mask] = 0
        self._state = watched_update(self._model, self._state, values, mask, self._round)[0]
        self._round = self._round + 1
        self._rated += mask.sum(axis=1)
        self._provided += mask.sum(axis=0)

    @property
    def trust(self) -> Trust:
        """Trust to publish after the rounds so far."""
        tor, top = self._model.rater_trust(self._state), self._model.provider_trust(self._state)
        return Trust(tuple(tor.tolist()), tuple(top.tolist()), self._toa(tor, top))

    def _toa(self, tor: NDArray[np.float64], top: NDArray[np.float64]) -> tuple[float, ...]:
        """Return the trust of the agents with both roles by Algorithm 3.

        Only rated services count, since the manager cannot see a service that nobody rated.
        """
        rater = [self.team.raters.index(name) for name in self.team.dual_role]
        provider = [self.team.providers.index(name) for name in self.team.dual_role]
        counts = {"rated": self._rated[rater], "provided": self._provided[provider]}
        return tuple(agent_trust(tor[rater], top[provider], initial=self._initial, **counts).tolist())


def _form(value: Any) -> Any:
    """Return what two values must have in common: type, shape and dtype."""
    return (value.shape, value.dtype) if isinstance(value, np.ndarray) else type(value)
