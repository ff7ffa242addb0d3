"""Presence of agents: joining, leaving, and admission control."""

from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.frozen import Frozen
from roletrust_env.shapes import Shape
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario

WAITING, PRESENT, LEFT, CUT_OFF = 0, 1, 2, 3


Phases: TypeAlias = Annotated[Array, Shape("N ...", "whole")]
"""`WAITING`, `PRESENT`, `LEFT` or `CUT_OFF` for each agent, shape (N, ...)."""


class Population(NamedTuple):
    """Presence of each agent.

    Attributes:
        phase: `WAITING`, `PRESENT`, `LEFT` or `CUT_OFF`, integers of shape (N, ...). The last two
            are final: an agent can come back only under another identity.
        low: Number of successive rounds in which the trust of a present agent was below the
            threshold, integers of shape (N, ...).
    """

    phase: Phases
    low: Annotated[Array, Shape("N ...", "whole")]


class Presence(Frozen):
    """Rules of joining, leaving and admission control.

    Args:
        scenario: Scenario with the groups and the admission control.
        roster: Agents of the scenario.
        like: Array of the library, dtype and device to work with.
    """

    def __init__(self, scenario: Scenario, roster: Roster, like: Array) -> None:
        self._admission = scenario.admission
        self.changes = scenario.admission is not None or any(
            group.open for group in scenario.agents
        )
        """True if agents can join, leave or be cut off. If not, all agents are present in every
        round."""

        def column(values: list[Any]) -> Array:
            return namespace(like).asarray(
                np.asarray(values, float), dtype=like.dtype, device=like.device
            )

        never = float("inf")
        self._joins = column([group.joins for group in roster.groups])
        self._join_rate = column([group.join_rate for group in roster.groups])
        self._leaves = column(
            [never if group.leaves is None else group.leaves for group in roster.groups]
        )
        self._leave_rate = column([group.leave_rate for group in roster.groups])
        self._reserves = None
        if any(roster.identity_index):
            has_reserve = column([group.reserve for group in roster.groups]) > 0
            self._reserves = has_reserve, column(list(roster.identity_index)) > 0

    def start(self, noise: Array) -> Population:
        """Return the population of round 0, given uniform noise of shape (N, ...)."""
        xp = namespace(noise)
        waiting = xp.zeros_like(noise, dtype=xp.int32)
        return Population(self._join_and_leave(waiting, waiting[0], noise, None), waiting)

    def step(
        self,
        population: Population,
        round: Array,
        trust: Array,
        noise: Array,
        wanted: Array | None = None,
    ) -> Population:
        """Return the population of the next round.

        Args:
            population: Population of the round that ends.
            round: Number of the round that begins, shape (...).
            trust: Trust of each agent after the round that ends, shape (N, ...).
            noise: Uniform noise, shape (N, ...).
            wanted: Boolean array of shape (N, ...), true where an owner wants an identity to be
                present. It matters only for agents of groups with identities in reserve: a present
                identity that is not wanted leaves for good, and a waiting one joins when it is
                wanted. None changes nothing.
        """
        xp = namespace(noise)
        phase, low = population
        if self._admission is not None:
            low = xp.where((phase == PRESENT) & (trust < self._admission.threshold), low + 1, 0)
            phase = xp.where(low >= self._admission.rounds, CUT_OFF, phase)
        return Population(self._join_and_leave(phase, round, noise, wanted), low)

    def _join_and_leave(
        self, phase: Array, round: Array, noise: Array, wanted: Array | None
    ) -> Array:
        def for_games(column: Array) -> Array:
            return column.reshape(column.shape + (1,) * (noise.ndim - 1))

        xp = namespace(noise)
        joins = (
            (phase == WAITING)
            & (round >= for_games(self._joins))
            & (noise < for_games(self._join_rate))
        )
        leaves = (phase == PRESENT) & (noise < for_games(self._leave_rate))
        if self._reserves is not None:
            has_reserve, in_reserve = map(for_games, self._reserves)
            joins = joins & (~in_reserve if wanted is None else ~in_reserve | wanted)
            if wanted is not None:
                leaves = leaves | (phase == PRESENT) & has_reserve & ~wanted
        expired = (round >= for_games(self._leaves)) & (phase <= PRESENT)
        phase = xp.where(joins, PRESENT, xp.where(leaves, LEFT, phase))
        return xp.where(expired, LEFT, phase)
