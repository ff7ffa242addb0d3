"""The PettingZoo environment in which agents act in turn (AEC)."""

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
    agents = property(lambda self: self.env.agents)
    agent_selection = property(lambda self: self.env.agent_selection)
    terminations = property(lambda self: self.env.terminations)
    truncations = property(lambda self: self.env.truncations)
    rewards = property(lambda self: self.env.rewards)
    infos = property(lambda self: self.env.infos)

    def __repr__(self) -> str:
        return repr(self.env.env).replace("Parallel", "AEC", 1)

    def last(self, observe: bool = True) -> tuple[Vector | None, float, bool, bool, dict[str, Any]]:
        """See `pettingzoo.AECEnv.last`."""
        found: tuple[Vector | None, float, bool, bool, dict[str, Any]]
        found = self.env.last(observe) if self._has_reset else super().last(observe)
        return found

    def _repr_html_(self) -> str:
        return str(self.env.env._spectator.html(repr(self), self.env.env._state))


class _AgentsInTurn(parallel_to_aec_wrapper[str, Vector, Vector]):
    """Refuses a wrong action at once, and not only after the last agent has acted."""

    def observe(self, agent: str) -> Vector | None:
        if agent not in self.possible_agents:
            raise ValueError(f"there is no agent {agent!r}; there are {shown(self.possible_agents)}")
        observation: Vector | None = super().observe(agent)
        return observation

    def step(self, action: Vector | None) -> None:
        agent = self.agent_selection
        if self.terminations[agent] or self.truncations[agent]:
            if action is not None:
                raise ValueError(f"the part of {agent!r} has ended; its action must be None")
        elif complaint := self.env.complaint(agent, action):
            raise ValueError(complaint)
        super().step(action)
