"""What learners learn from: games that are out of step, and actions that spread less and less."""

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback

from roletrust_env.envs.sb3 import AttackVecEnv
from roletrust_env.envs.vec_env_base import Flags, Floats, Step


class StaggeredGames(AttackVecEnv):
    """A batch whose games are not all in the same round, or a rollout would show but a short stretch of the game.

    The first episode of each game is truncated at another round; learners bootstrap there. Arguments as for
    `AttackVecEnv`.
    """

    def _restart(self, ended: Flags | None) -> None:
        super()._restart(ended)
        if ended is None:
            self._rounds = 0

    def _play(self, actions: Floats) -> Step:
        step = super()._play(actions)
        self._rounds += 1
        length = self.task.game.scenario.max_cycles
        ends = np.ceil(np.arange(1, self.num_envs + 1) * length / self.num_envs)
        return step._replace(truncated=step.truncated | ((ends == self._rounds) & ~step.terminated))


class Narrowing(BaseCallback):
    """Keeps the spread of a Gaussian policy below a limit, whose logarithm falls in a straight line.

    Args:
        first: the logarithm of the limit of the standard deviation at the begin.
        last: the same at the end.
        steps: rounds of the training, of all games together.
    """

    def __init__(self, first: float, last: float, steps: int) -> None:
        super().__init__()
        self._first, self._last, self._steps = first, last, steps

    def _on_rollout_start(self) -> None:
        limit = self._first + (self._last - self._first) * min(1.0, self.num_timesteps / self._steps)
        policy: Any = self.model.policy
        with torch.no_grad():
            policy.log_std.clamp_(max=limit)

    def _on_step(self) -> bool:
        return True
