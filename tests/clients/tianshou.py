"""Tianshou: its vectors of tasks, and its face of games in turn."""

from functools import partial

import gymnasium
import numpy as np
import supersuit
from tianshou.env import DummyVectorEnv, PettingZooEnv, SubprocVectorEnv

import roletrust_env
from clients.games import TASKS


def tasks() -> None:
    """100 rounds of every task in its vectors, in this process and in others."""
    for task_id in TASKS:
        for vector in (DummyVectorEnv, SubprocVectorEnv):
            envs = vector([partial(gymnasium.make, task_id)] * 2)
            envs.reset(seed=0)
            for _ in range(100):
                envs.step(np.stack([space.sample() for space in envs.action_space]))
            envs.close()


def games() -> None:
    """50 rounds in turn: of peers as they are, of paper-3x3 padded."""
    padded = supersuit.pad_action_space_v0(
        supersuit.pad_observations_v0(roletrust_env.env("paper-3x3"))
    )
    for env in (PettingZooEnv(roletrust_env.env("peers")), PettingZooEnv(padded)):
        env.reset()
        for _ in range(50 * len(env.agents)):
            env.step(env.action_space.sample())
