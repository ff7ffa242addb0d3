"""skrl: rounds through its wrappers, and its PPO."""

from typing import Any

import gymnasium
import torch
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.trainers.torch import SequentialTrainer
from skrl.utils.model_instantiators.torch import deterministic_model, gaussian_model

import roletrust_env
from clients.games import OPEN, TASKS, closed


def tasks() -> None:
    """100 rounds of every task, and of a batch of it."""
    for task_id in TASKS:
        for env in (
            wrap_env(gymnasium.make(task_id)),
            wrap_env(gymnasium.make_vec(task_id, num_envs=8)),
        ):
            env.reset()
            for _ in range(100):
                actions = torch.rand(env.num_envs, *env.action_space.shape)
                _, _, terminated, truncated, _ = env.step(actions)
                if (terminated | truncated).any():
                    env.reset()  # which does nothing to a batch


def games() -> None:
    """100 rounds of every closed scenario."""
    for name in closed():
        _play(roletrust_env.parallel_env(name))


def everybody() -> None:
    """100 rounds of open-system, behind FixedAgents."""
    _play(roletrust_env.FixedAgents(roletrust_env.parallel_env(OPEN)))


def clipping() -> None:
    """100 rounds of PPO whose Gaussian clips by itself, clip_actions=True, and of one behind
    RescaleClipAction."""
    _learn(gymnasium.make_vec(TASKS[1], num_envs=8), clip_actions=True)
    _learn(roletrust_env.RescaleClipAction(gymnasium.make(TASKS[1])), clip_actions=False)


def _learn(env: Any, clip_actions: bool) -> None:
    wrapped = wrap_env(env)
    spaces = {"observation_space": wrapped.observation_space, "action_space": wrapped.action_space}
    network = [{"name": "net", "input": "OBSERVATIONS", "layers": [16], "activations": "tanh"}]
    policy = gaussian_model(**spaces, clip_actions=clip_actions, network=network, output="ACTIONS")
    value = deterministic_model(**spaces, network=network, output="ONE")
    settings = PPO_CFG(rollouts=16)
    settings.experiment.write_interval = settings.experiment.checkpoint_interval = 0
    memory = RandomMemory(memory_size=16, num_envs=wrapped.num_envs)
    learner = PPO(models={"policy": policy, "value": value}, memory=memory, cfg=settings, **spaces)
    # Not headless, it would render environments that were made without a render mode.
    rounds = {"timesteps": 100, "headless": True, "disable_progressbar": True}
    SequentialTrainer(env=wrapped, agents=learner, cfg=rounds).train()


def _play(env: Any) -> None:
    wrapped = wrap_env(env)
    wrapped.reset()
    for _ in range(100):
        wrapped.step(
            {agent: torch.rand(1, *wrapped.action_space(agent).shape) for agent in env.agents}
        )
        assert set(wrapped.state()) == set(env.possible_agents)
        if not env.agents:
            wrapped.reset()
