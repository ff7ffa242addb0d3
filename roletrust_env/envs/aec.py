"""The PettingZoo environment in which agents act in turn (AEC)."""

from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from typing import Any

from pettingzoo import AECEnv
from pettingzoo.utils.conversions import parallel_to_aec_wrapper
from pettingzoo.utils.wrappers import OrderEnforcingWrapper

from roletrust_env.envs.observer import Vector
from roletrust_env.envs.parallel import parallel_env
from roletrust_env.envs.spectator import RenderMode
from roletrust_env.trust import TrustModel
from roletrust_env.world import Scenario
from roletrust_env.world.roster import shown


def env(
    scenario: str | Path | Scenario = "paper-3x3",
    trust_model: str | TrustModel[Any] = "role-trust",
    render_mode: RenderMode | None = None,
    **changes: Any,
) -> AECEnv[str, Vector, Vector | None]:
    """Return the game as a PettingZoo AEC environment, in which agents act in turn. Arguments as for `parallel_env`."""
    return RoleTrustAECEnv(_AgentsInTurn(parallel_env(scenario, trust_model, render_mode, **changes)))


class RoleTrustAECEnv(OrderEnforcingWrapper[str, Vector, Vector]):
    """The game with agents in turn. It refuses `step` before `reset`."""

    # The wrapper looks attributes up by name, which takes longer than the game. Before `reset` there are none.
    agents = property(attrgetter("env.agents"))
    agent_selection = property(attrgetter("env.agent_selection"))
    terminations = property(attrgetter("env.terminations"))
    truncations = property(attrgetter("env.truncations"))
    rewards = property(attrgetter("env.rewards"))
    infos = property(attrgetter("env.infos"))

    def __repr__(self) -> str:
        return repr(self.env.env).replace("Parallel", "AEC", 1)

    def last(self, observe: bool = True) -> tuple[Vector | None, float, bool, bool, dict[str, Any]]:
        """See `pettingzoo.AECEnv.last`."""
        found: tuple[Vector | None, float, bool, bool, dict[str, Any]]
        found = self.env.last(observe) if self._has_reset else super().last(observe)
        return found

    def step(self, action: Vector | None) -> None:
        """See `pettingzoo.AECEnv.step`."""
        if self._has_reset and self.env.agents:
            self._has_updated = True
            self.env.step(action)
        else:
            super().step(action)

    def _repr_html_(self) -> str:
        return str(self.env.env._spectator.html(repr(self), self.env.env._state))


class _AgentsInTurn(parallel_to_aec_wrapper[str, Vector, Vector]):
    """Plays as PettingZoo's own class, in a third of its time.

    It refuses a wrong action at once, and not only after the last agent has acted.
    """

    agents: list[str]
    agent_selection: str
    terminations: dict[str, bool]
    truncations: dict[str, bool]
    _first: str  # of those that are present
    _next: dict[str, str]  # who acts after an agent; nobody after the last

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        super().reset(seed, options)
        self._begin_turns()

    def observe(self, agent: str) -> Vector | None:
        if agent not in self.possible_agents:
            raise ValueError(f"there is no agent {agent!r}; there are {shown(self.possible_agents)}")
        observation: Vector | None = super().observe(agent)
        return observation

    def last(self, observe: bool = True) -> tuple[Vector | None, float, bool, bool, dict[str, Any]]:
        agent = self.agent_selection
        return (
            self._observations[agent] if observe else None,
            self._cumulative_rewards[agent],
            self.terminations[agent],
            self.truncations[agent],
            self.infos[agent],
        )

    def step(self, action: Vector | None) -> None:
        agent = self.agent_selection
        if self.terminations[agent] or self.truncations[agent]:
            if action is not None:
                raise ValueError(f"the part of {agent!r} has ended; its action must be None")
            super().step(None)
            return
        if complaint := self.env.complaint(agent, action):
            raise ValueError(complaint)
        self._actions[agent] = action
        if agent in self._next:
            if agent == self._first:
                self._clear_rewards()
            self.agent_selection = self._next[agent]
            return
        played = self.env.step(self._actions)
        self._observations, self.rewards, self.terminations, self.truncations, self.infos = played
        self._cumulative_rewards = self.rewards.copy()
        if self.agents == self.env.agents:
            self.agent_selection = self._first
            return
        self.agents = self.env.agents + sorted(self._observations.keys() - set(self.env.agents))
        self._begin_turns()
        self._deads_step_first()

    def _begin_turns(self) -> None:
        """Take the order of the agents that are present, if any is."""
        if live := self.env.agents:
            self._first = self.agent_selection = live[0]
            self._next = dict(pairwise(live))
