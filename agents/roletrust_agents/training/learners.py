"""The learners of `roletrust train`, and their conversion to saved networks."""

import io
from typing import Any

import numpy as np
import torch
from gymnasium.spaces import Box
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import recursive_getattr, recursive_setattr
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.utils import LinearSchedule
from torch import nn

from roletrust_agents.learned.network import Architecture, Floats, Network
from roletrust_agents.training.heads import HeadsPolicy, heads_of
from roletrust_agents.training.settings import (
    Algo,
    LearnerSettings,
    RecurrentPPOSettings,
    SACSettings,
)
from roletrust_env.envs.sb3 import AttackVecEnv
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.randomness import generator

_NORMALISING_GAMES = 16


class Normalised(BaseFeaturesExtractor):
    """Observations normalised by a mean and a standard deviation that are fixed before training and
    saved with it.
    """

    mean: torch.Tensor
    variance: torch.Tensor

    def __init__(self, observation_space: Box, mean: Floats, variance: Floats) -> None:
        super().__init__(observation_space, len(mean))
        self.register_buffer("mean", torch.as_tensor(mean))
        self.register_buffer("variance", torch.as_tensor(variance))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Normalise as `roletrust_agents.learned.network.Network` does."""
        scaled: torch.Tensor = (observations - self.mean) / torch.sqrt(self.variance)
        return scaled.clamp(-10.0, 10.0)


def make_model(
    algo: Algo, settings: LearnerSettings, env: AttackVecEnv, seed: int
) -> BaseAlgorithm:
    """Return an untrained learner."""
    mean, variance = _statistics(env.task, seed)
    shape: dict[str, Any] = {
        "net_arch": list(settings.hidden),
        "features_extractor_class": Normalised,
        "features_extractor_kwargs": {"mean": mean, "variance": variance},
    }
    common: dict[str, Any] = {
        "learning_rate": LinearSchedule(settings.learning_rate, 0.0, 1.0),
        "gamma": settings.gamma,
        "batch_size": settings.batch_size,
        "seed": seed,
        "device": "cpu",
    }
    if isinstance(settings, SACSettings):
        return SAC(
            "MlpPolicy",
            env,
            gradient_steps=settings.gradient_steps,
            buffer_size=settings.buffer_size,
            learning_starts=settings.learning_starts,
            policy_kwargs=shape,
            **common,
        )
    common |= settings.model_dump(
        include={"n_steps", "n_epochs", "gae_lambda", "clip_range", "ent_coef"}
    )
    common["batch_size"] = min(settings.batch_size, settings.n_steps * settings.games)
    shape["log_std_init"] = settings.log_std_init
    if isinstance(settings, RecurrentPPOSettings):
        return RecurrentPPO(
            "MlpLstmPolicy",
            env,
            policy_kwargs={**shape, "lstm_hidden_size": settings.lstm},
            **common,
        )
    if not settings.heads:
        return PPO("MlpPolicy", env, policy_kwargs=shape, **common)
    shape |= {"net_arch": {"pi": [], "vf": shape["net_arch"]}, "head_hidden": settings.heads}
    shape["heads"] = heads_of(env.task, len(mean))
    return PPO(HeadsPolicy, env, policy_kwargs=shape, **common)


def normalising_rounds(task: AttackTask) -> int:
    """Return the number of rounds, over all games, that determine the normalisation before
    training.
    """
    return _NORMALISING_GAMES * min(task.game.scenario.max_cycles, 500)


def _statistics(task: AttackTask, seed: int) -> tuple[Floats, Floats]:
    """Return the mean and the variance of each entry of the observations in games with random
    actions.
    """
    env, rng = AttackVecEnv(task, _NORMALISING_GAMES, seed=seed), generator(seed)
    rows, shape = [np.asarray(env.reset())], (_NORMALISING_GAMES, task.action_size)
    for _ in range(normalising_rounds(task) // _NORMALISING_GAMES):
        observation, *_ = env.step(rng.uniform(-1, 1, shape).astype(np.float32))
        rows.append(np.asarray(observation))
    seen = np.concatenate(rows)
    variance = seen.var(axis=0)
    return seen.mean(axis=0), np.where(variance < 1e-6, 1.0, variance).astype(np.float32)


def parameters_bytes(model: BaseAlgorithm) -> bytes:
    """Return all parameters of the learner, including its optimisers."""
    states, variables = model._get_torch_save_params()
    states_by_name = {name: recursive_getattr(model, name).state_dict() for name in states}
    loose = {name: recursive_getattr(model, name).data for name in variables}
    file = io.BytesIO()
    torch.save({"states": states_by_name, "variables": loose}, file)
    return file.getvalue()


def set_parameters(model: BaseAlgorithm, data: bytes) -> None:
    """Restore the output of `parameters_bytes`. Only tensors are read, and no code runs."""
    saved = torch.load(io.BytesIO(data), weights_only=True)
    model.set_parameters(saved["states"], exact_match=True)
    for name, value in saved["variables"].items():
        recursive_setattr(model, f"{name}.data", value)


def network_of(model: BaseAlgorithm) -> Network:
    """Return the network that plays, without the parts that only training needs."""
    policy: Any = model.policy
    if isinstance(policy, HeadsPolicy):
        return _network_of_heads(policy)
    lstm = None
    if isinstance(model, SAC):
        features, hidden, head = (
            policy.actor.features_extractor,
            policy.actor.latent_pi,
            policy.actor.mu,
        )
    else:
        features, hidden, head = (
            policy.features_extractor,
            policy.mlp_extractor.policy_net,
            policy.action_net,
        )
        lstm = getattr(policy, "lstm_actor", None)
    weights: dict[str, Floats] = {}
    if lstm is not None:
        weights["lstm.input"], weights["lstm.hidden"] = (
            _array(lstm.weight_ih_l0),
            _array(lstm.weight_hh_l0),
        )
        weights["lstm.bias"] = _array(lstm.bias_ih_l0 + lstm.bias_hh_l0)
    layers = [layer for layer in hidden if isinstance(layer, nn.Linear)]
    for i, layer in enumerate([*layers, head]):
        weights[f"layer{i}.weight"], weights[f"layer{i}.bias"] = (
            _array(layer.weight),
            _array(layer.bias),
        )
    architecture = Architecture(
        inputs=len(features.mean),
        outputs=head.out_features,
        hidden=tuple(layer.out_features for layer in layers),
        activation="relu" if isinstance(model, SAC) else "tanh",
        squash="tanh" if isinstance(model, SAC) else "clip",
        lstm=lstm.hidden_size if lstm is not None else 0,
    )
    return Network(architecture, _array(features.mean), _array(features.variance), weights)


def _network_of_heads(policy: HeadsPolicy) -> Network:
    features: Any = policy.features_extractor
    actor: Any = policy.action_net
    weights = {
        name: _array(weight) for name, weight in actor.named_parameters()
    }  # named as in the architecture
    outputs = sum(len(head.outputs) for head in actor.cards)
    architecture = Architecture(
        inputs=len(features.mean), outputs=outputs, hidden=policy.head_hidden, heads=actor.cards
    )
    return Network(architecture, _array(features.mean), _array(features.variance), weights)


def _array(tensor: torch.Tensor) -> Floats:
    array: Floats = tensor.detach().numpy().astype(np.float32)
    return array
