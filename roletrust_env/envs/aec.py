"""The PettingZoo environment in which agents act in turn (AEC)."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

from pettingzoo import AECEnv
from pettingzoo.utils.conversions import parallel_to_aec_wrapper
from pettingzoo.utils.env_logger import EnvLogger

from roletrust_env.envs.arguments import Engine
from roletrust_env.envs.parallel import Vector, parallel_env
from roletrust_env.envs.spectator import RenderMode
from roletrust_env.trust import TrustModel
from roletrust_env.world import Scenario
from roletrust_env.world.roster import shown


def env(
    scenario: str | Path | Scenario = "paper-3x3",
    trust_model: str | TrustModel[Any] = "role-trust",
    render_mode: RenderMode | None = None,
    engine: Engine = "rules",
    **changes: Any,
) -> AECEnv[str, Vector, Vector | None]:
    """Return the game as a PettingZoo AEC environment, in which agents act in turn. Arguments as
    for `parallel_env`.
    """
    return RoleTrustAECEnv(parallel_env(scenario, trust_model, render_mode, engine, **changes))


class RoleTrustAECEnv(parallel_to_aec_wrapper[str, Vector, Vector]):
    """The game with agents in turn, as PettingZoo's own conversion plays it, in a third of its
    time.

    It refuses a wrong action at once, and not only after the last agent has acted; and `step`
    before `reset`.
    """

    agents: list[str]
    agent_selection: str
    terminations: dict[str, bool]
    truncations: dict[str, bool]
    _waits: bool  # for `step`, in a loop
    _first: str  # of those that are present
    _next: dict[str, str]  # who acts after an agent; nobody after the last

    def __repr__(self) -> str:
        return repr(self.env).replace("Parallel", "AEC", 1)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"{type(self).__name__} has no {name!r}, or none before reset()")

    def _repr_html_(self) -> str:
        return str(self.env._spectator.html(repr(self), self.env._state))

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """See `pettingzoo.AECEnv.reset`."""
        super().reset(seed, options)
        self._waits = False
        self._begin_turns()

    def agent_iter(self, max_iter: int = 2**63) -> Iterator[str]:
        """See `pettingzoo.AECEnv.agent_iter`. A loop that does not call `step` is refused."""
        for agent in super().agent_iter(max_iter):
            self._waits = True
            yield agent
            if self._waits:
                raise RuntimeError("agent_iter: the loop must call step() or reset()")

    def observe(self, agent: str) -> Vector | None:
        """See `pettingzoo.AECEnv.observe`."""
        if agent not in self.possible_agents:
            raise ValueError(
                f"there is no agent {agent!r}; there are {shown(self.possible_agents)}"
            )
        observation: Vector | None = super().observe(agent)
        return observation

    def last(self, observe: bool = True) -> tuple[Vector | None, float, bool, bool, dict[str, Any]]:
        """See `pettingzoo.AECEnv.last`."""
        agent = self.agent_selection
        return (
            self._observations[agent] if observe else None,
            self._cumulative_rewards[agent],
            self.terminations[agent],
            self.truncations[agent],
            self.infos[agent],
        )

    def step(self, action: Vector | None) -> None:
        """See `pettingzoo.AECEnv.step`."""
        agent, self._waits = self.agent_selection, False
        try:
            ended = self.terminations[agent] or self.truncations[agent]
        except KeyError:  # nobody is left
            EnvLogger.warn_step_after_terminated_truncated()
            return
        if ended:
            if action is not None:
                raise ValueError(f"the part of {agent!r} has ended; its action must be None")
            super().step(None)
            return
        self._actions[agent] = self.env.joint.check(agent, action)
        following = self._next.get(agent)
        if following is not None:
            if agent == self._first:
                self._clear_rewards()
            self.agent_selection = following
            return
        acting = {live: self._actions[live] for live in self.env.agents}
        played = self.env.advance(self.env.joint.place(acting))
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
