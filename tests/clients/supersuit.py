"""SuperSuit: its wrappers, and its vector of agents."""

from typing import Any

import numpy as np
import supersuit

import roletrust_env
from clients.games import OPEN


def wrappers() -> None:
    """150 rounds behind frame_skip_v0, clip_actions_v0, black_death_v3 and the paddings."""
    some_are_cut_off: Any = {"admission": {"threshold": 0.4, "rounds": 2}}
    for name in ("paper-3x3", "peers"):
        _play(supersuit.frame_skip_v0(roletrust_env.parallel_env(name), 4))
        _play(supersuit.clip_actions_v0(roletrust_env.parallel_env(name)))
        _play(supersuit.black_death_v3(roletrust_env.parallel_env(name, **some_are_cut_off)))
        _play(_alike(roletrust_env.parallel_env(name)))


def vectors() -> None:
    """150 rounds of concat_vec_envs_v1: of paper-3x3 and, behind FixedAgents, of open-system."""
    for env in (
        roletrust_env.parallel_env(),
        roletrust_env.FixedAgents(roletrust_env.parallel_env(OPEN)),
    ):
        one = supersuit.pettingzoo_env_to_vec_env_v1(_alike(env))
        vector = supersuit.concat_vec_envs_v1(one, 2, base_class="gymnasium")
        vector.reset(seed=0)
        assert vector.num_envs == 2 * len(env.possible_agents)
        for _ in range(150):
            vector.step(np.stack([vector.action_space.sample() for _ in range(vector.num_envs)]))


def _alike(env: Any) -> Any:
    """All agents with the same spaces."""
    return supersuit.pad_action_space_v0(supersuit.pad_observations_v0(env))


def _play(env: Any) -> None:
    env.reset(seed=0)
    for _ in range(150):
        if not env.agents:
            env.reset()
        env.step({agent: env.action_space(agent).sample() for agent in env.agents})
