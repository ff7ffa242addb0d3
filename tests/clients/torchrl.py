"""TorchRL: the specs of tasks, of batches and of games."""

from torchrl.envs import EnvCreator, GymEnv, ParallelEnv, PettingZooWrapper
from torchrl.envs.utils import check_env_specs

import roletrust_env
from clients.games import OPEN, TASK, TASKS, closed


def tasks() -> None:
    """check_env_specs of every task through GymEnv."""
    for task_id in TASKS:
        check_env_specs(GymEnv(task_id))


def batches() -> None:
    """check_env_specs of a batch of every task through GymEnv."""
    for task_id in TASKS:
        check_env_specs(GymEnv(task_id, num_envs=3))


def workers() -> None:
    """Play a rollout of 100 rounds in two other processes."""
    env = ParallelEnv(2, EnvCreator(lambda: GymEnv(TASK)))
    assert env.rollout(100).shape == (2, 100)
    env.close()


def games() -> None:
    """check_env_specs of every closed scenario through PettingZooWrapper."""
    for name in closed():
        check_env_specs(PettingZooWrapper(roletrust_env.parallel_env(name), return_state=True))


def everybody() -> None:
    """check_env_specs of open-system through PettingZooWrapper, behind FixedAgents."""
    env = PettingZooWrapper(roletrust_env.FixedAgents(roletrust_env.parallel_env(OPEN)))
    check_env_specs(env)
    present = env.rollout(100)["sr", "info", "present"]
    assert 0 < present.float().mean() < 1
