"""Experience of learners: staggered games, whole games, actions whose spread narrows, and calls
after updates.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback

from roletrust_env.envs.sb3 import AttackVecEnv, Flags, Floats, Step


def update_memory(model: Any) -> int:
    """Return the memory of an update in bytes: twice the data of its rollout, 0 for a learner
    without rollouts.
    """
    buffer = getattr(model, "rollout_buffer", None)
    return (
        2 * sum(part.nbytes for part in vars(buffer).values() if isinstance(part, np.ndarray))
        if buffer
        else 0
    )


class StaggeredGames(AttackVecEnv):
    """A batch whose games are in different rounds, so that a short rollout covers the whole game.

    The first episode of each game is truncated at a different round, where learners bootstrap.
    Arguments as for `AttackVecEnv`.
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


class WholeGames(AttackVecEnv):
    """A batch in which the end of a game ends its rewards: learners do not bootstrap, since they
    observe the clock.

    No game ends at random; rewards are times the weight of the round, see `Scenario.round_weights`.
    Arguments as for `AttackVecEnv`.
    """

    _whole = True

    def _play(self, actions: Floats) -> Step:
        step = super()._play(actions)
        rewards = step.rewards * self._weights[self._batch.games.round - 1]
        return Step(
            rewards, step.terminated | step.truncated, np.zeros_like(step.truncated), step.infos
        )

    @cached_property
    def _weights(self) -> Floats:
        return self.task.game.scenario.round_weights.astype(np.float32)


class Narrowing(BaseCallback):
    """Callback that limits the spread of a Gaussian policy; the logarithm of the limit falls
    linearly.

    Args:
        first: Logarithm of the limit of the standard deviation at the beginning.
        last: Logarithm of the limit at the end.
        steps: Number of rounds of the training, over all games.
    """

    def __init__(self, first: float, last: float, steps: int) -> None:
        super().__init__()
        self._first, self._last, self._steps = first, last, steps

    def _on_rollout_start(self) -> None:
        limit = self._first + (self._last - self._first) * min(
            1.0, self.num_timesteps / self._steps
        )
        policy: Any = self.model.policy
        with torch.no_grad():
            policy.log_std.clamp_(max=limit)

    def _on_step(self) -> bool:
        return True


class AfterUpdates(BaseCallback):
    """Callback that calls a function after each update of a learner that plays rollouts.

    Args:
        rollout: Number of rounds of a rollout, over all games.
        call: Function of the number of updates so far.
    """

    def __init__(self, rollout: int, call: Callable[[int], None]) -> None:
        super().__init__()
        self._rollout, self._call = rollout, call

    def _on_rollout_start(self) -> None:
        if self.num_timesteps:
            self._call(self.num_timesteps // self._rollout)

    def _on_training_end(self) -> None:
        self._call(self.num_timesteps // self._rollout)

    def _on_step(self) -> bool:
        return True
