"""Cost of the environment for a learner: frames per second of PPO on a task and on an empty environment."""

from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv

from roletrust_agents.training.learners import make_model
from roletrust_agents.training.settings import PPOSettings
from roletrust_env.envs.sb3 import AttackVecEnv, BatchVecEnv, Flags, Floats, Step
from roletrust_env.game.make_task import make_task


class PPOSpeed(NamedTuple):
    """Frames per second of PPO on the task and on an empty environment, and their ratio.

    Each is from the fastest turn, the one that other work on the machine disturbed least.
    """

    task: float
    nothing: float
    share: float


class NoGame(BatchVecEnv):
    """An empty `VecEnv` with the spaces and the size of another one.

    Args:
        like: Other environment, whose games have a fixed length.
        length: Length of an episode in rounds.
    """

    def __init__(self, like: AttackVecEnv, length: int) -> None:
        zeros: Floats = np.zeros((like.num_envs, *(like.observation_space.shape or ())), np.float32)
        self._zeros, self._length, self._round = zeros, length, 0
        self._infos: list[dict[str, Any]] = [{} for _ in range(like.num_envs)]
        seen: Any = like.observation_space
        action: Any = like.action_space
        super().__init__(like.num_envs, like.task.game, seen, action, scaled=False, seed=0)

    def step_async(self, actions: Any) -> None:
        """Ignore the actions."""

    def step_wait(self) -> tuple[Floats, Floats, Flags, list[dict[str, Any]]]:
        """Return zeros."""
        self._round += 1
        over = self._round % self._length == 0
        return self._zeros, self._zeros[:, 0], np.full(self.num_envs, over), self._infos

    def _restart(self, ended: Flags | None) -> None:
        self._round = 0

    def _play(self, actions: Floats) -> Step:
        raise NotImplementedError("no round is ever played")

    def _observe(self) -> Floats:
        return self._zeros


def ppo_speed(*, games: int = 256, rollouts: int = 8, turns: int = 5, seed: int = 0) -> PPOSpeed:
    """Measure PPO with the settings of `roletrust train`, in turn on `ProviderAttack` and on an empty environment.

    Args:
        games: Size of the batch.
        rollouts: Number of rollouts with updates in a turn.
        turns: Number of turns of each environment.
        seed: Random seed.
    """
    settings = PPOSettings(games=games)
    task = make_task("paper-3x3", ("sp_2",), objective="exploit", max_cycles=200)
    env = AttackVecEnv(task, games)
    on_task, on_nothing = make_model("ppo", settings, env, seed), make_model("ppo", settings, env, seed)
    _put(on_nothing, NoGame(env, 200))
    frames = rollouts * settings.n_steps * games
    speeds = np.asarray([[_speed(model, frames) for model in (on_task, on_nothing)] for _ in range(turns + 1)][1:])
    on_the_task, on_none = speeds.max(axis=0).tolist()
    return PPOSpeed(on_the_task, on_none, on_the_task / on_none)


def _put(model: BaseAlgorithm, env: VecEnv) -> None:
    """Give the learner another environment."""
    assert isinstance(model, PPO)
    model.set_env(env)


def _speed(model: BaseAlgorithm, frames: int) -> float:
    """Return the frames per second of one turn."""
    began = perf_counter()
    model.learn(frames, reset_num_timesteps=False)
    return frames / (perf_counter() - began)
