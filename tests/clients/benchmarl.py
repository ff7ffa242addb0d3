"""BenchMARL: two iterations of its learners."""

from collections.abc import Callable
from typing import Any

from benchmarl.algorithms import IqlConfig, MappoConfig, MasacConfig
from benchmarl.environments.pettingzoo.common import PettingZooClass
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from torchrl.envs import PettingZooWrapper

import roletrust_env
from clients.games import OPEN


class RoleTrustTask(PettingZooClass):
    """A scenario as a task of BenchMARL, with continuous actions or three levels of each."""

    def get_env_fun(
        self, num_envs: int, continuous_actions: bool, seed: int | None, device: Any
    ) -> Callable[[], PettingZooWrapper]:
        """Return the factory of the environment."""

        def make() -> PettingZooWrapper:
            env = roletrust_env.FixedAgents(roletrust_env.parallel_env(**self.config))
            if not continuous_actions:
                env = roletrust_env.ParallelTransformAction(
                    env, roletrust_env.DiscretizeLevels, levels=3
                )
            return PettingZooWrapper(
                env, return_state=True, categorical_actions=True, seed=seed, device=device
            )

        return make

    def supports_continuous_actions(self) -> bool:
        """Return that continuous actions are supported."""
        return True

    def supports_discrete_actions(self) -> bool:
        """Return that discrete actions are supported."""
        return True

    def has_state(self) -> bool:
        """Return that the environment has a state."""
        return True

    def has_render(self, env: Any) -> bool:
        """Return that the environment has no rendering."""
        return False

    @staticmethod
    def env_name() -> str:
        """Return the name of the environment."""
        return "roletrust"


def mappo() -> None:
    """Two iterations of MAPPO."""
    _train(MappoConfig, "paper-3x3")


def masac() -> None:
    """Two iterations of MASAC."""
    _train(MasacConfig, "paper-3x3")


def levels() -> None:
    """Two iterations of IQL with discrete actions, behind ParallelTransformAction with
    DiscretizeLevels."""
    _train(IqlConfig, "paper-3x3")


def everybody() -> None:
    """Two iterations of MAPPO in open-system, behind FixedAgents."""
    _train(MappoConfig, OPEN)


def _train(algorithm: Any, scenario: str) -> None:
    config = ExperimentConfig.get_from_yaml()
    config.max_n_iters, config.max_n_frames = 2, None
    for policy in ("on", "off"):
        setattr(config, f"{policy}_policy_collected_frames_per_batch", 200)
        setattr(config, f"{policy}_policy_n_envs_per_worker", 2)
    config.on_policy_minibatch_size, config.on_policy_n_minibatch_iters = 50, 1
    config.off_policy_train_batch_size, config.off_policy_n_optimizer_steps = 32, 2
    config.evaluation_interval, config.evaluation_episodes = 200, 1
    config.render, config.loggers, config.create_json = False, [], False
    experiment = Experiment(
        task=RoleTrustTask("roletrust", {"scenario": scenario, "max_cycles": 20}),
        algorithm_config=algorithm.get_from_yaml(),
        model_config=MlpConfig.get_from_yaml(),
        critic_model_config=MlpConfig.get_from_yaml(),
        seed=0,
        config=config,
    )
    experiment.run()
    assert experiment.n_iters_performed == 2
