"""Roster: names and roles of the agents of a scenario, and their indices among raters, providers
and agents.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

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
    """Agents of a scenario in the order SR, SP, SR+SP.

    With this order the raters and the providers are made of slices of the agents. Agents: `[SR | SP
    | SR+SP]`; raters: `[SR | SR+SP]`; providers: `[SP | SR+SP]`. Each identity in reserve is an
    agent of its own. It comes after all first identities of its role.

    Attributes:
        groups: Group of each agent.
        identity_index: Index of each agent among the identities of its owner: 0 for the first
            identity, 1 and above for those in reserve.
        previous_identity: Index of the agent that is the previous identity of the same owner; for a
            first identity, its own index.
    """

    groups: tuple[AgentGroup, ...]
    identity_index: tuple[int, ...]
    previous_identity: tuple[int, ...]

    @classmethod
    def of(cls, scenario: Scenario) -> "Roster":
        """Return the roster of a scenario."""
        owners = [group for group in scenario.agents for _ in range(group.count)]
        order: dict[Role, int] = {"SR": 0, "SP": 1, "SR+SP": 2}
        agents = [
            (owner, k) for owner, group in enumerate(owners) for k in range(1 + group.reserve)
        ]
        agents.sort(key=lambda agent: (order[owners[agent[0]].role], agent[1] > 0))
        index = {agent: n for n, agent in enumerate(agents)}
        return cls(
            groups=tuple(owners[owner] for owner, _ in agents),
            identity_index=tuple(k for _, k in agents),
            previous_identity=tuple(index[owner, max(k - 1, 0)] for owner, k in agents),
        )

    @cached_property
    def _count(self) -> dict[Role, int]:
        roles = [group.role for group in self.groups]
        return {"SR": roles.count("SR"), "SP": roles.count("SP"), "SR+SP": roles.count("SR+SP")}

    @cached_property
    def _distinct(self) -> tuple[list[AgentGroup], npt.NDArray[np.intp]]:
        """Return each group once, and the place of each agent's group among them. Groups are told
        apart as objects.
        """
        distinct = {id(group): group for group in self.groups}
        places = {key: n for n, key in enumerate(distinct)}
        return list(distinct.values()), np.asarray([places[id(group)] for group in self.groups])

    def of_groups(self, value: Callable[[AgentGroup], Any]) -> npt.NDArray[Any]:
        """Return a value of the group of each agent, shape (N, ...); it is computed once for each
        group.
        """
        distinct, places = self._distinct
        return np.asarray([value(group) for group in distinct])[places]

    @cached_property
    def own_provider(self) -> npt.NDArray[np.int64]:
        """Index of the provider that is the same agent as each rater, shape (S,); P where there is
        none.
        """
        own = np.full(self.n_raters, self.n_providers)
        own[self.n_raters - self.n_both :] = np.arange(
            self.n_providers - self.n_both, self.n_providers
        )
        own.flags.writeable = False
        return own

    @cached_property
    def n_agents(self) -> int:
        """Number of agents, N."""
        return len(self.groups)

    @cached_property
    def n_both(self) -> int:
        """Number of SR+SP agents. They are the last ones on every axis."""
        return self._count["SR+SP"]

    @cached_property
    def n_raters(self) -> int:
        """Number of raters, S."""
        return self._count["SR"] + self.n_both

    @cached_property
    def n_providers(self) -> int:
        """Number of providers, P."""
        return self._count["SP"] + self.n_both

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the agents: `sr_0 ...`, `sp_0 ...`, `srsp_0 ...`."""
        return tuple(f"{PREFIXES[role]}_{i}" for role, n in self._count.items() for i in range(n))

    @cached_property
    def roles(self) -> dict[str, Role]:
        """Role of each agent, by its name."""
        return dict(zip(self.names, (group.role for group in self.groups), strict=True))

    def role(self, name: str) -> Role:
        """Return the role of an agent.

        Raises:
            ValueError: The scenario has no agent of that name.
        """
        if name not in self.roles:
            raise ValueError(f"there is no agent {name!r}; the scenario has {shown(self.names)}")
        return self.roles[name]

    def action_size(self, name: str) -> int:
        """Return the size of the action of an agent: its quality, if it provides, and P ratings, if
        it rates.
        """
        role = self.role(name)
        return (role != "SR") + self.n_providers * (role != "SP")

    @cached_property
    def rater_names(self) -> tuple[str, ...]:
        """Names of the raters."""
        return self.names[: self._count["SR"]] + self.names[self.n_agents - self.n_both :]

    @cached_property
    def provider_names(self) -> tuple[str, ...]:
        """Names of the providers."""
        return self.names[self._count["SR"] :]

    @cached_property
    def rater_places(self) -> dict[str, int]:
        """Index of each rater among the raters, by its name."""
        return {name: place for place, name in enumerate(self.rater_names)}

    @cached_property
    def provider_places(self) -> dict[str, int]:
        """Index of each provider among the providers, by its name."""
        return {name: place for place, name in enumerate(self.provider_names)}

    @cached_property
    def owners(self) -> dict[str, str]:
        """Name of the owner of each agent, by the name of the agent. An owner has the name of its
        first identity.
        """
        owners: dict[str, str] = {}
        for _, name, previous in sorted(
            zip(self.identity_index, self.names, self.previous_identity, strict=True)
        ):
            owners[name] = owners.get(self.names[previous], name)
        return {name: owners[name] for name in self.names}

    def with_reserves(self, by_name: Mapping[str, T]) -> dict[str, T]:
        """Return a mapping by name of agent in which the identities in reserve have the value of
        their owner.
        """
        return {name: by_name[owner] for name, owner in self.owners.items() if owner in by_name}

    @cached_property
    def owner_names(self) -> tuple[str, ...]:
        """Names of all agents except the identities in reserve."""
        return tuple(
            name for name, k in zip(self.names, self.identity_index, strict=True) if k == 0
        )

    @cached_property
    def not_self(self) -> npt.NDArray[np.bool_]:
        """Boolean array of shape (S, P), true where rater and provider are not the same agent."""
        pairs = np.asarray(self.own_provider[:, None] != np.arange(self.n_providers))
        pairs.flags.writeable = False
        return pairs

    def raters(self, of_agents: Array) -> Array:
        """Return the rows of the raters, shape (S, ...), of an array over agents, shape (N,
        ...).
        """
        sr = of_agents[: self._count["SR"]]
        return (
            namespace(of_agents).concat([sr, of_agents[self.n_agents - self.n_both :]])
            if self.n_both
            else sr
        )

    def providers(self, of_agents: Array) -> Array:
        """Return the rows of the providers, shape (P, ...), of an array over agents, shape (N,
        ...).
        """
        return of_agents[self._count["SR"] :]

    def both(self, of_raters_or_providers: Array) -> Array:
        """Return the rows of the SR+SP agents of an array over raters or over providers."""
        return of_raters_or_providers[of_raters_or_providers.shape[0] - self.n_both :]

    def role_schedule(self, max_cycles: int) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
        """Return which raters rate and which providers provide, by their role in each round.

        Returns:
            Two boolean arrays of the shapes (max_cycles, S) and (max_cycles, P).
        """

        def plays(role: Role) -> npt.NDArray[np.bool_]:
            return self.of_groups(
                lambda group: [role in group.role_in(round) for round in range(max_cycles)]
            )

        return self.raters(plays("SR")).T, self.providers(plays("SP")).T


def shown(names: Sequence[str]) -> str:
    """Return names for an error message: all of them, or the first and the last five."""
    return ", ".join(names if len(names) <= 12 else [*names[:5], "...", *names[-5:]])


def places(names: Sequence[str], axis: Sequence[str]) -> list[int]:
    """Return the indices of names on an axis, in the order of the names; names that are not on it
    are left out.
    """
    return [axis.index(name) for name in names if name in axis]
