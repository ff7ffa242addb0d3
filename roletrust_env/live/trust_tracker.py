"""What a team's trust is after the rounds so far, under any trust model."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from roletrust_env.trust import TrustModel, agent_trust, check_trust_model
from roletrust_env.trust.model import start_model
from roletrust_env.trust.model_checks import watched_update

Rows = Mapping[str, Sequence[float | None]]
"""The ratings of a round: of each rater, a rating of each provider in the team's order, or None."""


@dataclass(frozen=True)
class Team:
    """Who stands where on the axes. An agent with both roles is on both.

    Attributes:
        raters: their names, in the order of axis 0.
        providers: their names, in the order of axis 1.
    """

    raters: tuple[str, ...] = ()
    providers: tuple[str, ...] = ()

    def joined(self, raters: Iterable[str], providers: Iterable[str]) -> "Team":
        """The team with newcomers behind the others."""
        return Team(tuple(dict.fromkeys((*self.raters, *raters))), tuple(dict.fromkeys((*self.providers, *providers))))

    @property
    def peers(self) -> NDArray[np.bool_]:
        """Where a rater and a provider are one agent, shape (S, P)."""
        return np.array([[rater == provider for provider in self.providers] for rater in self.raters], bool)

    @property
    def both(self) -> tuple[str, ...]:
        """The agents with both roles, in the order of the raters."""
        return tuple(name for name in self.raters if name in self.providers)


class Trust(NamedTuple):
    """The trust of a team.

    Attributes:
        tor: of each rater.
        top: of each provider.
        toa: of each agent with both roles.
    """

    tor: tuple[float, ...]
    top: tuple[float, ...]
    toa: tuple[float, ...]


class Standing:
    """The trust of a team of one or more raters and providers, from round to round: that of a game with the same masks.

    Args:
        model: see `TrustModel`.
        team: who stands where.
        past: the rounds so far. Whoever is not in them is as one who was there and never rated, nor was rated.

    Raises:
        ValueError: the model is not sound, see `check_trust_model` and `watched_update`.
    """

    def __init__(self, model: TrustModel[Any], team: Team, past: Iterable[Rows] = ()) -> None:
        like = np.zeros((len(team.raters), len(team.providers)))
        check_trust_model(model, team.peers, np.zeros(()))
        self.team, self._model = team, model
        self._state = start_model(model, like, team.peers)
        self._initial = getattr(model, "initial", 0.5)
        self._round = np.zeros((), int)
        self._rated, self._provided = np.zeros(like.shape[0]), np.zeros(like.shape[1])
        for rows in past:
            self.take(rows)

    def take(self, rows: Rows) -> None:
        """Play one round."""
        ratings = np.full((len(self._rated), len(self._provided)), np.nan)
        for name, row in rows.items():
            ratings[self.team.raters.index(name), : len(row)] = [np.nan if rating is None else rating for rating in row]
        mask = ~np.isnan(ratings)
        ratings[~mask] = 0
        self._state = watched_update(self._model, self._state, ratings, mask, self._round)[0]
        self._round = self._round + 1
        self._rated += mask.sum(axis=1)
        self._provided += mask.sum(axis=0)

    @property
    def trust(self) -> Trust:
        """What is published after the rounds so far."""
        tor, top = self._model.rater_trust(self._state), self._model.provider_trust(self._state)
        return Trust(tuple(tor.tolist()), tuple(top.tolist()), self._toa(tor, top))

    def _toa(self, tor: NDArray[np.float64], top: NDArray[np.float64]) -> tuple[float, ...]:
        """Algorithm 3, by the services that were rated: of one that nobody rated, nobody on the wire knows."""
        rater = [self.team.raters.index(name) for name in self.team.both]
        provider = [self.team.providers.index(name) for name in self.team.both]
        counts = {"rated": self._rated[rater], "provided": self._provided[provider]}
        return tuple(agent_trust(tor[rater], top[provider], initial=self._initial, **counts).tolist())
