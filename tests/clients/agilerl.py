"""AgileRL: rounds in its vectors of processes, as its own learners play them."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from agilerl.algorithms import IPPO, MADDPG
from agilerl.vector.pz_async_vec_env import AsyncPettingZooVecEnv

import roletrust_env
from clients.games import OPEN, closed


def games() -> None:
    """100 rounds of every closed scenario, twice at once."""
    for name in closed():
        envs = AsyncPettingZooVecEnv([partial(roletrust_env.parallel_env, name)] * 2)
        spaces = {agent: envs.single_action_space(agent) for agent in envs.possible_agents}
        envs.reset(seed=0)
        for _ in range(100):
            envs.step(
                {
                    agent: np.stack([space.sample(), space.sample()])
                    for agent, space in spaces.items()
                }
            )
        envs.close()


def maddpg() -> None:
    """100 rounds of MADDPG, whose actions stay in their space."""
    _play(MADDPG, roletrust_env.parallel_env)


def everybody() -> None:
    """100 rounds of MADDPG in open-system, behind FixedAgents."""
    _play(MADDPG, lambda: roletrust_env.FixedAgents(roletrust_env.parallel_env(OPEN)))


def scaled() -> None:
    """100 rounds of IPPO, whose Gaussian is not clipped, behind ParallelTransformAction with
    RescaleClipAction."""
    _play(
        IPPO,
        lambda: roletrust_env.ParallelTransformAction(
            roletrust_env.parallel_env(), roletrust_env.RescaleClipAction
        ),
    )


def levels() -> None:
    """100 rounds of IPPO with discrete actions, behind ParallelTransformAction with
    DiscretizeLevels."""
    _play(
        IPPO,
        lambda: roletrust_env.ParallelTransformAction(
            roletrust_env.parallel_env(), roletrust_env.DiscretizeLevels, levels=5
        ),
    )


def _play(algorithm: Any, make: Callable[[], Any]) -> None:
    envs = AsyncPettingZooVecEnv([make, make])
    agents = envs.possible_agents
    seen = [envs.single_observation_space(agent) for agent in agents]
    done = [envs.single_action_space(agent) for agent in agents]
    learner = algorithm(seen, done, agent_ids=agents)
    observations, infos = envs.reset(seed=0)
    for _ in range(100):
        actions = learner.get_action(observations, infos=infos)[0]
        observations, *_, infos = envs.step(actions)
    envs.close()
