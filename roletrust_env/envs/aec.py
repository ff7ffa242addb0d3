"""The PettingZoo face in which agents act in turn (AEC)."""

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


def env(
    scenario: str | Path | Scenario = "paper-3x3",
    trust_model: str | TrustModel[Any] = "role-trust",
    render_mode: RenderMode | None = None,
    **changes: Any,
) -> AECEnv[str, Vector, Vector | None]:
    """The game as a PettingZoo AEC environment, agents in turn. Arguments as for `parallel_env`."""
    return OrderEnforcingWrapper(_AgentsInTurn(parallel_env(scenario, trust_model, render_mode, **changes)))


class _AgentsInTurn(parallel_to_aec_wrapper[str, Vector, Vector]):
    """Refuses a bad action at once, not when the last agent has acted."""

    def step(self, action: Vector | None) -> None:
        agent = self.agent_selection
        if self.terminations[agent] or self.truncations[agent]:
            if action is not None:
                raise ValueError(f"the part of {agent!r} has ended; its action must be None")
        elif complaint := self.env.complaint(agent, action):
            raise ValueError(complaint)
        super().step(action)
