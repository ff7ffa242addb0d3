"""RLlib: two iterations of its PPO, for one learner and for many."""

from collections.abc import Callable
from typing import Any

import ray
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env

import roletrust_env
from clients.games import OPEN, TASK
from roletrust_env.world.roster import PREFIXES, role_in_name


def task() -> None:
    """Two iterations on a task."""
    _train(PPOConfig().environment(TASK, env_config={"max_cycles": 20}))


def worker() -> None:
    """Two iterations on a task in another process."""
    _train(PPOConfig().environment(TASK, env_config={"max_cycles": 20}), workers=1)


def game() -> None:
    """Two iterations on a game, a policy for each role."""
    _train_roles(lambda: roletrust_env.parallel_env(max_cycles=20))


def levels() -> None:
    """Two iterations on a game with discrete actions, behind ParallelTransformAction with
    DiscretizeLevels."""
    _train_roles(
        lambda: roletrust_env.ParallelTransformAction(
            roletrust_env.parallel_env(max_cycles=20), roletrust_env.DiscretizeLevels, levels=3
        )
    )


def everybody() -> None:
    """Two iterations on open-system, behind FixedAgents."""
    _train_roles(lambda: roletrust_env.FixedAgents(roletrust_env.parallel_env(OPEN, max_cycles=20)))


def _train_roles(make: Callable[[], Any]) -> None:
    register_env("roletrust", lambda config: ParallelPettingZooEnv(make()))
    roles = {_role(agent) for agent in make().possible_agents}
    _train(
        PPOConfig().environment("roletrust").multi_agent(policies=roles, policy_mapping_fn=_role)
    )


def _role(agent: str, *_: object, **__: object) -> str:
    return PREFIXES[role_in_name(agent)]


def _train(config: Any, workers: int = 0) -> None:
    ray.init(num_cpus=2, include_dashboard=False, ignore_reinit_error=True)
    config = config.env_runners(num_env_runners=workers)
    algorithm = config.training(
        train_batch_size_per_learner=200, minibatch_size=50, num_epochs=1
    ).build_algo()
    for _ in range(2):
        found = algorithm.train()
    algorithm.stop()
    assert found["env_runners"]["num_env_steps_sampled"] >= 200
