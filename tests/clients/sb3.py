"""Stable-Baselines3: its checker, its wrappers, its learners and its videos."""

import tempfile
from pathlib import Path

import gymnasium
import numpy as np
from gymnasium.wrappers.vector import RecordVideo
from stable_baselines3 import DQN, PPO, SAC
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import (
    VecFrameStack,
    VecMonitor,
    VecNormalize,
    VecVideoRecorder,
)

import roletrust_env
from clients.games import TASK, TASKS


def tasks() -> None:
    """check_env of every task, as it is and behind RescaleClipAction and DiscretizeLevels."""
    for task_id in TASKS:
        check_env(gymnasium.make(task_id))
        check_env(roletrust_env.RescaleClipAction(gymnasium.make(task_id)))
        check_env(roletrust_env.DiscretizeLevels(gymnasium.make(task_id), 3, multidiscrete=True))


def wrappers() -> None:
    """PPO and evaluate_policy on AttackVecEnv, behind VecMonitor, VecFrameStack and
    VecNormalize."""
    task = roletrust_env.make_task("paper-3x3", ["sp_2"], objective="exploit", max_cycles=20)
    env = VecNormalize(VecFrameStack(VecMonitor(roletrust_env.AttackVecEnv(task, 8)), 2))
    model = PPO("MlpPolicy", env, n_steps=20, batch_size=80, device="cpu").learn(320)
    evaluate_policy(model, env, n_eval_episodes=8)


def learners() -> None:
    """SAC on a task, and DQN behind DiscretizeLevels."""
    SAC("MlpPolicy", gymnasium.make(TASK), learning_starts=50, device="cpu").learn(150)
    DQN(
        "MlpPolicy",
        roletrust_env.DiscretizeLevels(gymnasium.make(TASK), 5),
        learning_starts=50,
        device="cpu",
    ).learn(150)


def videos() -> None:
    """VecVideoRecorder of AttackVecEnv, and Gymnasium's RecordVideo of a batch: both show the first
    game."""
    task = roletrust_env.make_task("paper-3x3", ["sp_2"], objective="exploit", max_cycles=20)
    with tempfile.TemporaryDirectory() as folder:
        slots = roletrust_env.AttackVecEnv(task, 8, render_mode="rgb_array")
        film = VecVideoRecorder(slots, folder, lambda step: step == 0, video_length=5)
        film.reset()
        for _ in range(6):
            film.step(np.zeros((8, 1), np.float32))
        film.close()
        batch = gymnasium.make_vec(TASK, num_envs=8, max_cycles=5, render_mode="rgb_array")
        films = RecordVideo(batch, folder, record_first_only=True)
        films.reset(seed=0)
        for _ in range(7):
            films.step(films.action_space.sample())
        films.close()
        assert len(list(Path(folder).glob("*.mp4"))) == 3
