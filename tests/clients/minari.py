"""Minari: a data set of a task, and the task back from it."""

import os
import tempfile

import gymnasium
import minari
import numpy as np

from clients.games import TASK


def collection() -> None:
    """Episodes of a task are collected, saved and, in the recovered task, played again to the last
    bit."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MINARI_DATASETS_PATH"] = folder
        env = minari.DataCollector(gymnasium.make(TASK, max_cycles=30, noise=0.1))
        for seed in range(3):
            env.reset(seed=seed)
            over = False
            while not over:
                *_, terminated, truncated, _ = env.step(env.action_space.sample())
                over = terminated or truncated
        env.create_dataset("roletrust/provider-v0", algorithm_name="random")
        found = minari.load_dataset("roletrust/provider-v0")
        assert (found.total_episodes, found.total_steps) == (3, 90)
        again = found.recover_environment()
        assert again.spec.max_episode_steps == 30
        for seed, episode in enumerate(found.iterate_episodes()):
            seen = [
                again.reset(seed=seed)[0],
                *(again.step(action)[0] for action in episode.actions),
            ]
            assert np.array_equal(seen, episode.observations)
