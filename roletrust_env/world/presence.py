"""Who is present: joining, leaving, and admission control."""

from typing import Any, NamedTuple

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario

WAITING, PRESENT, LEFT, CUT_OFF = 0, 1, 2, 3


class Population(NamedTuple):
    """Where each agent is in its life.

    Attributes:
        phase: shape (N, ...), integer: `WAITING`, `PRESENT`, `LEFT` or `CUT_OFF`. The last two are for good: whoever
            wants to come back comes as another identity.
        low: shape (N, ...), integer: rounds in succession that a present agent's trust has been under the threshold.
    """

    phase: Array
    low: Array


class Presence:
    """The rules of joining, leaving and being cut off.

    Args:
        scenario: whose groups join and leave and whose admission control applies.
        roster: the scenario's agents.
        like: an array of the library, dtype and device to work with.
    """

    def __init__(self, scenario: Scenario, roster: Roster, like: Array) -> None:
        self._admission = scenario.admission
        self.changes = scenario.admission is not None or any(group.open for group in scenario.agents)
        """Whether anybody ever joins, leaves or is cut off; if not, there is no need to ask who is present."""

        def column(values: list[Any]) -> Array:
            return namespace(like).asarray(np.asarray(values, float), dtype=like.dtype, device=like.device)

        never = float("inf")
        self._joins = column([group.joins for group in roster.groups])
        self._join_rate = column([group.join_rate for group in roster.groups])
        self._leaves = column([never if group.leaves is None else group.leaves for group in roster.groups])
        self._leave_rate = column([group.leave_rate for group in roster.groups])
        self._owned = None
        if any(roster.turn):
            self._owned = column([group.reserve for group in roster.groups]) > 0, column(list(roster.turn)) > 0

    def start(self, luck: Array) -> Population:
        """The population of round 0. `luck` is uniform noise of shape (N, ...)."""
        xp = namespace(luck)
        waiting = xp.zeros_like(luck, dtype=xp.int32)
        return Population(self._come_and_go(waiting, waiting[0], luck, None), waiting)

    def step(
        self, population: Population, round: Array, trust: Array, luck: Array, wanted: Array | None = None
    ) -> Population:
        """The population of the next round.

        Args:
            population: of the round that ends.
            round: number of the round that begins, shape (...).
            trust: of each agent after the round that ends, shape (N, ...).
            luck: uniform noise, shape (N, ...).
            wanted: where an owner with identities in reserve wants an identity to be there, boolean, (N, ...): one that
                is there and not wanted leaves for good, and one in reserve comes when it is wanted. It counts for
                agents of groups with a reserve only; None leaves everybody where they are.
        """
        xp = namespace(luck)
        phase, low = population
        if self._admission is not None:
            low = xp.where((phase == PRESENT) & (trust < self._admission.threshold), low + 1, 0)
            phase = xp.where(low >= self._admission.rounds, CUT_OFF, phase)
        return Population(self._come_and_go(phase, round, luck, wanted), low)

    def _come_and_go(self, phase: Array, round: Array, luck: Array, wanted: Array | None) -> Array:
        def over(column: Array) -> Array:
            return column.reshape(column.shape + (1,) * (luck.ndim - 1))

        xp = namespace(luck)
        joins = (phase == WAITING) & (round >= over(self._joins)) & (luck < over(self._join_rate))
        leaves = (phase == PRESENT) & (luck < over(self._leave_rate))
        if self._owned is not None:
            has_reserve, in_reserve = map(over, self._owned)
            joins = joins & (~in_reserve if wanted is None else ~in_reserve | wanted)
            if wanted is not None:
                leaves = leaves | (phase == PRESENT) & has_reserve & ~wanted
        expired = (round >= over(self._leaves)) & (phase <= PRESENT)
        phase = xp.where(joins, PRESENT, xp.where(leaves, LEFT, phase))
        return xp.where(expired, LEFT, phase)
