"""The observations of the agents of a PettingZoo game."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from roletrust_env.game.game import Game
from roletrust_env.game.state import State

Vector = npt.NDArray[np.float32]


class Observer:
    """Makes the observations of single agents.

    Everything that any agent observes is written into one vector, from which each agent's entries are picked.

    Args:
        game: Game that is observed.
    """

    def __init__(self, game: Game) -> None:
        roster = game.roster
        s, p = roster.n_raters, roster.n_providers
        self._game = game
        self._clock = np.zeros(1)
        self._everything = np.zeros(1 + s + 3 * p + 4 * s * p + roster.n_both, np.float32)
        of_raters, of_providers = game.layout.places()
        provider = dict(zip(roster.provider_names, of_providers.T, strict=True))
        rater = dict(zip(roster.rater_names, of_raters.T, strict=True))
        toa = len(self._everything) - roster.n_both
        seen: dict[str, list[npt.NDArray[np.intp]]] = {agent: [] for agent in roster.names}
        for i, agent in enumerate(agent for agent in roster.names if agent in provider and agent in rater):
            seen[agent].append(np.asarray([toa + i]))
        for agent, places in [*provider.items(), *rater.items()]:
            seen[agent].append(places)
        self._places = np.concatenate([part for parts in seen.values() for part in parts])
        ends = np.cumsum([sum(map(len, parts)) for parts in seen.values()]).tolist()
        starts = [0, *ends[:-1]]
        self._slices = {agent: slice(a, b) for agent, a, b in zip(seen, starts, ends, strict=True)}

    def observe(self, state: State, agents: Sequence[str]) -> dict[str, Vector]:
        """Return the observations of some agents in a state of one game, as new arrays."""
        game, slices = self._game, self._slices
        self._clock[0] = state.round / game.scenario.max_cycles
        grids = (state.service.ravel(), state.awaiting.ravel(), state.ratings.ravel(), state.rated.ravel())
        toa = (game.agent_trust(state)[-game.roster.n_both :],) if game.roster.n_both else ()
        parts = (self._clock, *game.published(state), state.value, state.quality, *grids, *toa)
        everything = np.concatenate(parts, out=self._everything, casting="unsafe")
        seen = everything[self._places]
        return {agent: seen[slices[agent]] for agent in agents}
