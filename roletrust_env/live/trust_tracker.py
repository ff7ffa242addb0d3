"""The trust of a team after the rounds so far, under any trust model."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roletrust_env.live.state_growth import grown_state
from roletrust_env.live.team import RatingRows, Team, Trust
from roletrust_env.trees import leaves, map_leaves
from roletrust_env.trust import TrustModel, agent_trust, check_trust_model
from roletrust_env.trust.model import start_model
from roletrust_env.trust.model_checks import watched_update
from roletrust_env.trust.ratings import Ratings


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

    def __init__(self, model: TrustModel[Any], team: Team, past: Iterable[RatingRows] = ()) -> None:
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

    def update(self, ratings: RatingRows) -> None:
        """Update trust with the ratings of one round."""
        values = np.full((len(self._rated), len(self._provided)), np.nan)
        for name, row in ratings.items():
            values[self.team.raters.index(name), : len(row)] = [np.nan if rating is None else rating for rating in row]
        mask = ~np.isnan(values)
        values[~mask] = 0
        self._state = watched_update(self._model, self._state, Ratings(values, mask), self._round)[0]
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
