"""The observations of the agents of a PettingZoo game."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array
from roletrust_env.game.game import Game
from roletrust_env.game.state import State

Vector = npt.NDArray[np.float32]


class Observer:
    """Makes the observations of single agents.

    Args:
        game: Game that is observed.
    """

    def __init__(self, game: Game) -> None:
        roster = game.roster
        s, p = roster.n_raters, roster.n_providers
        self._game = game
        size = 1 + s + 3 * p + 4 * s * p
        of_raters, of_providers = game.layout.places()
        provider = dict(zip(roster.provider_names, of_providers.T, strict=True))
        rater = dict(zip(roster.rater_names, of_raters.T, strict=True))
        seen: dict[str, list[npt.NDArray[np.intp]]] = {agent: [] for agent in roster.names}
        for i, agent in enumerate(
            agent for agent in roster.names if agent in provider and agent in rater
        ):
            seen[agent].append(np.asarray([size + i]))
        for agent, places in [*provider.items(), *rater.items()]:
            seen[agent].append(places)
        self._places = np.concatenate([part for parts in seen.values() for part in parts])
        ends = np.cumsum([sum(map(len, parts)) for parts in seen.values()]).tolist()
        self._slices = {
            agent: slice(*cut) for agent, cut in zip(seen, pairwise([0, *ends]), strict=True)
        }

    def observe(self, state: State) -> Array:
        """Return the observations of all agents in a state of one game, one after the other."""
        game = self._game
        clock = [int(state.round) / game.scenario.max_cycles]
        grids = (
            state.service.ravel(),
            state.awaiting.ravel(),
            state.ratings.ravel(),
            state.rated.ravel(),
        )
        toa = (game.agent_trust(state)[-game.roster.n_both :],) if game.roster.n_both else ()
        everything = np.concatenate(
            (clock, *game.published(state), state.value, state.quality, *grids, *toa)
        )
        return everything[self._places]

    def split(self, observations: Array, agents: Sequence[str]) -> dict[str, Vector]:
        """Return the observations of some agents, as new arrays, from those of all, see
        `observe`.
        """
        single, slices = observations.astype(np.float32), self._slices
        return {agent: single[slices[agent]] for agent in agents}
