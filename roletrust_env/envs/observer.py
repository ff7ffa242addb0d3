"""What the agents of a PettingZoo game observe, and what their infos hold."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.game import Game
from roletrust_env.game.state import State

Vector = npt.NDArray[np.float32]


class Shown(NamedTuple):
    """What the agents observe in a state, and what their infos hold.

    Attributes:
        round: Number of rounds played, shape ().
        observations: Observations of all agents, one after the other.
        trust: Trust of each agent by its role, shape (N,).
        quality: Quality that each provider delivered in the last round, shape (P,).
        received: True quality of the services that each rater received in it, shape (S, P).
        of_both: ToR and ToP of the SR+SP agents, shape (n_both,) each; None without any.
        phase: Phase of each agent, see `Population`, shape (N,); None where all are always present.
    """

    round: Array
    observations: Array
    trust: Array
    quality: Array
    received: Array
    of_both: tuple[Array, Array] | None
    phase: Array | None


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

    def show(self, state: State) -> Shown:
        """Return what all agents observe in a state of one game, and what their infos hold."""
        game, both = self._game, self._game.roster.both
        published, trust = game.published(state), game.agent_trust(state)
        has_both = game.roster.n_both > 0
        parts = (
            (state.round / game.scenario.max_cycles).reshape(1),
            *published,
            state.value,
            state.quality,
            *(grid.reshape(-1) for grid in (state.service, state.awaiting)),
            *(grid.reshape(-1) for grid in (state.ratings, state.rated)),
            *((trust[-game.roster.n_both :],) if has_both else ()),
        )
        return Shown(
            round=state.round,
            observations=namespace(trust).concat(parts)[self._places],
            trust=trust,
            quality=state.quality,
            received=state.quality * state.awaiting,
            of_both=(both(published[0]), both(published[1])) if has_both else None,
            phase=None if state.population is None else state.population.phase,
        )

    def split(self, observations: Array, agents: Sequence[str]) -> dict[str, Vector]:
        """Return the observations of some agents, as new arrays, from those of all, see
        `show`.
        """
        single, slices = observations.astype(np.float32), self._slices
        return {agent: single[slices[agent]] for agent in agents}
