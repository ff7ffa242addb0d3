"""JaxMARL: rollouts through its wrappers, in one compiled function."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxmarl.wrappers.baselines import LogWrapper

from roletrust_env import AttackJaxEnv, RoleTrustJaxEnv
from roletrust_env.envs.attack_env import TASKS


def games() -> None:
    """Two episodes and more of a game with agents of all roles, in 16 games, behind LogWrapper."""
    _play(RoleTrustJaxEnv("robots-that-move", max_cycles=20))


def tasks() -> None:
    """Two episodes and more of every task, in 16 games, behind LogWrapper."""
    for task_id in TASKS:
        _play(AttackJaxEnv(task_id, max_cycles=20))


def _play(env: Any) -> None:
    logged, sizes = LogWrapper(env), {agent: env.action_space(agent).shape for agent in env.agents}

    def play(state: Any, key: Any) -> tuple[Any, Any]:
        actions = {agent: jax.random.uniform(key, shape) for agent, shape in sizes.items()}
        _, state, _, _, infos = logged.step(key, state, actions)
        return state, (infos["returned_episode"], infos["returned_episode_lengths"])

    def episodes(key: Any) -> Any:
        return jax.lax.scan(play, logged.reset(key)[1], jax.random.split(key, 50))[1]

    ended, lengths = jax.jit(jax.vmap(episodes))(jax.random.split(jax.random.key(0), 16))
    assert ended.any(axis=-1).sum() == 2 * 16
    assert jnp.unique(lengths[:, -1]).tolist() == [20]
