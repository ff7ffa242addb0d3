"""The observations of the agents of a PettingZoo game."""

from collections.abc import Sequence
from struct import pack

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array
from roletrust_env.game.game import Game
from roletrust_env.game.state import State

Vector = npt.NDArray[np.float32]


class Observer:
    """Makes the observations of single agents.

    Everything that any agent observes is in one vector, from which each agent's entries are picked.

    Args:
        game: Game that is observed.

    Attributes:
        tor: Place of the trust of the raters in `everything`; so `top`, `toa` and `quality`.
    """

    def __init__(self, game: Game) -> None:
        roster = game.roster
        s, p = roster.n_raters, roster.n_providers
        self._game = game
        size = 1 + s + 3 * p + 4 * s * p
        self.tor, self.top, self.quality = slice(1, 1 + s), slice(1 + s, 1 + s + p), slice(1 + s + 2 * p, 1 + s + 3 * p)
        self.toa = slice(size, size + roster.n_both)
        of_raters, of_providers = game.layout.places()
        provider = dict(zip(roster.provider_names, of_providers.T, strict=True))
        rater = dict(zip(roster.rater_names, of_raters.T, strict=True))
        seen: dict[str, list[npt.NDArray[np.intp]]] = {agent: [] for agent in roster.names}
        for i, agent in enumerate(agent for agent in roster.names if agent in provider and agent in rater):
            seen[agent].append(np.asarray([size + i]))
        for agent, places in [*provider.items(), *rater.items()]:
            seen[agent].append(places)
        self._format = f"{size + roster.n_both}f"
        self._places = np.concatenate([part for parts in seen.values() for part in parts])
        ends = np.cumsum([sum(map(len, parts)) for parts in seen.values()]).tolist()
        starts = [0, *ends[:-1]]
        self._slices = {agent: slice(a, b) for agent, a, b in zip(seen, starts, ends, strict=True)}

    def everything(self, state: State) -> Array:
        """Return all that any agent observes in a state of one game, in the order of `Layout.places`, ToA last."""
        game = self._game
        clock = np.reshape(state.round / game.scenario.max_cycles, 1)
        grids = (state.service.ravel(), state.awaiting.ravel(), state.ratings.ravel(), state.rated.ravel())
        toa = (game.agent_trust(state)[-game.roster.n_both :],) if game.roster.n_both else ()
        return np.concatenate((clock, *game.published(state), state.value, state.quality, *grids, *toa))

    def observe(self, everything: Sequence[float] | Array, agents: Sequence[str]) -> dict[str, Vector]:
        """Return the observations of some agents, as new arrays, from `everything`."""
        if isinstance(everything, tuple):  # packed in half of the time of an array from numbers
            single = np.frombuffer(pack(self._format, *everything), np.float32)
        else:
            single = np.asarray(everything, np.float32)
        slices, seen = self._slices, single[self._places]
        return {agent: seen[slices[agent]] for agent in agents}
