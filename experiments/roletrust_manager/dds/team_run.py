"""The trust of a team after the rounds so far, under any trust model."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roletrust_env.trust import TrustModel, agent_trust
from roletrust_env.trust.grid_run import GridRun
from roletrust_env.trust.model_checks import try_trust_model
from roletrust_env.trust.ratings import Ratings
from roletrust_env.trust.stored import taken
from roletrust_manager.team import RatingRows, Team, Trust

_TRIALS, _ROUNDS = 18, 12
_DENSITIES = 0.2, 0.5, 0.9  # shares of the pairs that meet in a round
_NEAR = 1e-12  # sums over more agents may be rounded in another way


class TeamRun(GridRun):
    """The run of a team, in which rounds go by name. Its trust equals that of a game with the same
    masks.

    Attributes:
        team: Agents of the team.
    """

    def __init__(self, model: TrustModel[Any], team: Team, past: Iterable[RatingRows] = ()) -> None:
        """Start, and play the rounds so far.

        Args:
            model: Trust model, see `TrustModel`.
            team: One or more raters and providers.
            past: Ratings of the rounds so far. An agent that is missing there counts as present,
                but without ratings given or received.

        Raises:
            ValueError: The model is not sound, see `try_trust_model` and `watched_update`.
        """
        try_trust_model(model, team.peers, np.zeros(()))
        super().__init__(model, np.zeros(team.peers.shape), team.peers)
        self.team = team
        self._rated, self._provided = np.zeros(self.shape[0]), np.zeros(self.shape[1])
        for ratings in past:
            self.play_named(ratings)

    def grow(self, team: Team) -> None:
        """Add newcomers; see `grows` for the models that can.

        Args:
            team: Team with the same agents first.
        """
        self.join(len(team.raters), len(team.providers), team.peers)
        self._rated = np.pad(self._rated, (0, len(team.raters) - len(self._rated)))
        self._provided = np.pad(self._provided, (0, len(team.providers) - len(self._provided)))
        self.team = team

    def save(self) -> dict[str, NDArray[Any]]:
        """Return all that the run keeps, by name. See `TrustRun.save`."""
        return {**super().save(), "rated": self._rated, "provided": self._provided}

    def load(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go on from what another run of the same model and team has kept. See `TrustRun.load`."""
        left = dict(arrays)
        rated, provided = (taken(left, name, np.float64, (None,)) for name in ("rated", "provided"))
        super().load(left)
        if (len(rated), len(provided)) != self.shape or min(rated.min(), provided.min()) < 0:
            raise ValueError("the counts are of another team, or below 0")
        self._rated, self._provided = rated, provided

    def play_named(self, ratings: RatingRows) -> None:
        """Play one round.

        Args:
            ratings: Ratings of each rater, see `RatingRows`.
        """
        values = np.full(self.shape, np.nan)
        for name, row in ratings.items():
            values[self.team.raters.index(name), : len(row)] = [
                np.nan if rating is None else rating for rating in row
            ]
        mask = ~np.isnan(values)
        values[~mask] = 0
        self.update(Ratings(values, mask))
        self._rated += mask.sum(axis=1)
        self._provided += mask.sum(axis=0)

    @property
    def trust(self) -> Trust:
        """Trust to publish after the rounds so far."""
        tor, top = self.rater_trust, self.provider_trust
        return Trust(tuple(tor.tolist()), tuple(top.tolist()), self._toa(tor, top))

    def _toa(self, tor: NDArray[np.float64], top: NDArray[np.float64]) -> tuple[float, ...]:
        """Return the trust of the agents with both roles by Algorithm 3.

        Only rated services count, since the manager cannot see a service that nobody rated.
        """
        rater = [self.team.raters.index(name) for name in self.team.dual_role]
        provider = [self.team.providers.index(name) for name in self.team.dual_role]
        counts = {"rated": self._rated[rater], "provided": self._provided[provider]}
        initial = getattr(self.model, "initial", 0.5)
        return tuple(agent_trust(tor[rater], top[provider], initial=initial, **counts).tolist())


def grows(model: TrustModel[Any]) -> bool:
    """Return whether growing the state of a model is as good as a replay in which newcomers were
    silent before.

    This is tried on random ratings of small teams, with newcomers of every role.
    """
    random = np.random.default_rng(0)
    return all(_grows_once(model, random, trial) for trial in range(_TRIALS))


def _grows_once(model: TrustModel[Any], random: np.random.Generator, trial: int) -> bool:
    few = random.integers(1, 7, 2)
    many = few + [[1, 0], [0, 1], [2, 2]][trial % 3]
    peers = np.zeros(many, bool)
    peers[-1, -1] = peers[0, 0] = trial % 2 == 1
    ratings = random.random((2 * _ROUNDS, *many))
    mask = random.random((2 * _ROUNDS, *many)) < _DENSITIES[trial // 6]
    mask[:_ROUNDS, few[0] :] = mask[:_ROUNDS, :, few[1] :] = False
    mask &= ~peers
    ratings[~mask] = 0
    try:
        whole = GridRun(model, np.zeros(many), peers)
        part = GridRun(model, np.zeros(few), peers[: few[0], : few[1]])
        for values, met in zip(ratings[:_ROUNDS], mask[:_ROUNDS], strict=True):
            whole.update(Ratings(values, met))
            part.update(Ratings(values[: few[0], : few[1]].copy(), met[: few[0], : few[1]].copy()))
        part.join(int(many[0]), int(many[1]), peers)
        for values, met in zip(ratings[_ROUNDS:], mask[_ROUNDS:], strict=True):
            whole.update(Ratings(values, met))
            part.update(Ratings(values, met))
            if not (
                _near(whole.rater_trust, part.rater_trust)
                and _near(whole.provider_trust, part.provider_trust)
            ):
                return False
    except Exception:  # a model of another package may have any state
        return False
    return True


def _near(own: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    return bool(np.all(np.abs(own - other) <= _NEAR))
