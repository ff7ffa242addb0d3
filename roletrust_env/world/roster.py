"""The agents of a scenario: their names, their roles, and their places on the rater, provider and agent axes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array, namespace
from roletrust_env.world.group import AgentGroup, Role
from roletrust_env.world.scenario import Scenario

T = TypeVar("T")

PREFIXES: dict[Role, str] = {"SR": "sr", "SP": "sp", "SR+SP": "srsp"}
"""The first part of an agent's name, by role; the second part is a number."""


def role_in_name(agent: str) -> Role:
    """Return the role that an agent's name shows, for callers that have no roster.

    Args:
        agent: Name of an agent, such as `sr_0`.

    Raises:
        ValueError: The name does not begin like that of an agent.

    Example:
        >>> role_in_name("srsp_3")
        'SR+SP'
    """
    prefix = agent.partition("_")[0]
    for role, known in PREFIXES.items():
        if prefix == known:
            return role
    names = ", ".join(f"{known}_0" for known in PREFIXES.values())
    raise ValueError(f"there is no agent {agent!r}; agents are called {names} ...")


@dataclass(frozen=True)
class Roster:
    """The agents of a scenario in the order SR, SP, SR+SP, so that every axis is a slice of another.

    Agents: `[SR | SP | SR+SP]`; raters: `[SR | SR+SP]`; providers: `[SP | SR+SP]`. An identity in reserve is an agent
    of its own, behind all of its role that are not.

    Attributes:
        groups: the group of each agent, in this order.
        turn: of each agent among the identities of one owner: 0 is the first, and those from 1 on are in reserve.
        before: the identity before it, as a place among the agents; of a first one its own.
    """

    groups: tuple[AgentGroup, ...]
    turn: tuple[int, ...]
    before: tuple[int, ...]

    @classmethod
    def of(cls, scenario: Scenario) -> "Roster":
        """The roster of a scenario."""
        owners = [group for group in scenario.agents for _ in range(group.count)]
        order: dict[Role, int] = {"SR": 0, "SP": 1, "SR+SP": 2}
        agents = [(owner, turn) for owner, group in enumerate(owners) for turn in range(1 + group.reserve)]
        agents.sort(key=lambda agent: (order[owners[agent[0]].role], agent[1] > 0))
        place = {agent: n for n, agent in enumerate(agents)}
        return cls(
            groups=tuple(owners[owner] for owner, _ in agents),
            turn=tuple(turn for _, turn in agents),
            before=tuple(place[owner, max(turn - 1, 0)] for owner, turn in agents),
        )

    @cached_property
    def _count(self) -> dict[Role, int]:
        roles = [group.role for group in self.groups]
        return {"SR": roles.count("SR"), "SP": roles.count("SP"), "SR+SP": roles.count("SR+SP")}

    @cached_property
    def n_agents(self) -> int:
        """N, the number of agents."""
        return len(self.groups)

    @cached_property
    def n_both(self) -> int:
        """The number of SR+SP agents; they are the last ones on every axis."""
        return self._count["SR+SP"]

    @cached_property
    def n_raters(self) -> int:
        """S, the number of agents that can rate."""
        return self._count["SR"] + self.n_both

    @cached_property
    def n_providers(self) -> int:
        """P, the number of agents that can provide."""
        return self._count["SP"] + self.n_both

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The agents' names: `sr_0 ...`, `sp_0 ...`, `srsp_0 ...`."""
        return tuple(f"{PREFIXES[role]}_{i}" for role, n in self._count.items() for i in range(n))

    @cached_property
    def roles(self) -> dict[str, Role]:
        """The role of each agent, by name."""
        return dict(zip(self.names, (group.role for group in self.groups), strict=True))

    def role(self, name: str) -> Role:
        """Return the role of an agent.

        Raises:
            ValueError: The scenario has no agent of that name.
        """
        if name not in self.roles:
            raise ValueError(f"there is no agent {name!r}; the scenario has {shown(self.names)}")
        return self.roles[name]

    @cached_property
    def rater_names(self) -> tuple[str, ...]:
        """The names on the rater axis."""
        return self.names[: self._count["SR"]] + self.names[self.n_agents - self.n_both :]

    @cached_property
    def provider_names(self) -> tuple[str, ...]:
        """The names on the provider axis."""
        return self.names[self._count["SR"] :]

    @cached_property
    def owners(self) -> dict[str, str]:
        """Each agent's name, and that of the first identity of its owner, which is its own but for those in reserve."""
        owners: dict[str, str] = {}
        for _, name, before in sorted(zip(self.turn, self.names, self.before, strict=True)):
            owners[name] = owners.get(self.names[before], name)
        return {name: owners[name] for name in self.names}

    def with_reserves(self, by_name: Mapping[str, T]) -> dict[str, T]:
        """What is said of agents by name, such as how they play, said of their identities in reserve, too."""
        return {name: by_name[owner] for name, owner in self.owners.items() if owner in by_name}

    @cached_property
    def first_names(self) -> tuple[str, ...]:
        """The names of all agents but the identities in reserve."""
        return tuple(name for name, turn in zip(self.names, self.turn, strict=True) if turn == 0)

    @cached_property
    def stranger(self) -> npt.NDArray[np.bool_]:
        """Shape (S, P): true where rater and provider are two identities, so that one may rate the other."""
        raters, providers = np.asarray(self.rater_names), np.asarray(self.provider_names)
        return np.asarray(raters[:, None] != providers)

    def raters(self, of_agents: Array) -> Array:
        """The rows of the raters, (S, ...), of an array over agents, (N, ...)."""
        sr = of_agents[: self._count["SR"]]
        return namespace(of_agents).concat([sr, of_agents[self.n_agents - self.n_both :]]) if self.n_both else sr

    def providers(self, of_agents: Array) -> Array:
        """The rows of the providers, (P, ...), of an array over agents, (N, ...)."""
        return of_agents[self._count["SR"] :]

    def agents(self, of_raters: Array, of_providers: Array, of_both: Array | None) -> Array:
        """An array over agents, (N, ...), of one over raters, one over providers and one over SR+SP agents."""
        parts = [of_raters, of_providers]
        if of_both is not None:
            parts = [of_raters[: self._count["SR"]], of_providers[: self._count["SP"]], of_both]
        return namespace(of_raters).concat(parts)

    def both(self, of_raters_or_providers: Array) -> Array:
        """The rows of the SR+SP agents of an array over raters or over providers."""
        return of_raters_or_providers[of_raters_or_providers.shape[0] - self.n_both :]

    def on_duty(self, max_cycles: int) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
        """Who rates and who provides in which round: two arrays, (max_cycles, S) and (max_cycles, P)."""

        def plays(role: Role) -> npt.NDArray[np.bool_]:
            duty = {group: [role in group.role_in(r) for r in range(max_cycles)] for group in set(self.groups)}
            return np.asarray([duty[group] for group in self.groups])

        return self.raters(plays("SR")).T, self.providers(plays("SP")).T


def shown(names: Sequence[str]) -> str:
    """Return names for an error message: all of them, or the first and the last five."""
    return ", ".join(names if len(names) <= 12 else [*names[:5], "...", *names[-5:]])
