"""The learners of `roletrust train`: their settings, tuned per task, and how a trained one becomes a saved network."""

import io
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
import torch
from gymnasium.spaces import Box
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import recursive_getattr, recursive_setattr
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.utils import LinearSchedule
from torch import nn

from agents.learned.network import Architecture, Floats, Network
from roletrust_env.envs.sb3 import AttackVecEnv
from roletrust_env.errors import explain

Algo = Literal["ppo", "sac", "recurrent-ppo"]
Natural = Annotated[int, Field(ge=1, le=10_000_000)]
Rate = Annotated[float, Field(gt=0, le=1)]
Discount = Annotated[float, Field(ge=0, le=1)]


class _Settings(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    steps: Natural
    """Rounds to train for, of all games together, unless `--steps` says otherwise."""
    games: Natural
    """Games that are played as one batch."""
    gamma: Discount = 0.95
    learning_rate: Rate = 1e-3
    """At first; it falls to 0 in a straight line."""
    batch_size: Natural
    hidden: Annotated[tuple[Natural, ...], Field(min_length=1, max_length=8)] = (64, 64)
    """Units of each hidden layer."""


class PPOSettings(_Settings):
    """Of PPO: many games, short rollouts, and a spread of the actions that starts narrow."""

    steps: Natural = 800_000
    games: Natural = 256
    n_steps: Natural = 25
    """Rounds of each game between two updates."""
    batch_size: Natural = 1600
    n_epochs: Natural = 10
    gae_lambda: Discount = 0.95
    clip_range: Rate = 0.2
    ent_coef: Annotated[float, Field(ge=0, le=1)] = 0.0
    log_std_init: Annotated[float, Field(ge=-10, le=2)] = -0.5


class RecurrentPPOSettings(PPOSettings):
    """Of PPO with an LSTM, which also minds what it no longer sees."""

    steps: Natural = 400_000
    games: Natural = 128
    batch_size: Natural = 800
    n_epochs: Natural = 5
    lstm: Natural = 32
    """Units of the LSTM."""


class SACSettings(_Settings):
    """Of soft actor-critic, which learns from fewer rounds, each at a higher price."""

    steps: Natural = 100_000
    games: Natural = 16
    batch_size: Natural = 256
    gradient_steps: Natural = 4
    """Updates for each round of all games."""
    buffer_size: Natural = 100_000
    learning_starts: Natural = 5_000


Settings = PPOSettings | RecurrentPPOSettings | SACSettings
_KINDS: dict[str, type[Settings]] = {"ppo": PPOSettings, "sac": SACSettings, "recurrent-ppo": RecurrentPPOSettings}

TUNED: dict[tuple[str, str], dict[str, Any]] = {
    # Many actions at once: longer, in fewer passes over each rollout, and with an eye on the next ten rounds only.
    ("RoleTrust/CollusionAttack-v0", "ppo"): {
        "steps": 2_000_000,
        "gamma": 0.9,
        "n_epochs": 5,
        "learning_rate": 0.0015,
    },
}
"""Settings other than the algorithm's own, by task and algorithm."""


def make_settings(task_id: str, algo: Algo, changes: Mapping[str, Any]) -> Settings:
    """The settings for a task, with some changed.

    Raises:
        ValueError: a setting does not exist or its value is not allowed.
    """
    try:
        return _KINDS[algo].model_validate({**TUNED.get((task_id, algo), {}), **changes})
    except ValidationError as error:
        known = ", ".join(_KINDS[algo].model_fields)
        raise ValueError(f"--learner of {algo}: {explain(error)}; there are {known}") from None


class Normalised(BaseFeaturesExtractor):
    """Observations less their mean, by their standard deviation; both are fixed before training and saved with it."""

    mean: torch.Tensor
    variance: torch.Tensor

    def __init__(self, observation_space: Box, mean: Floats, variance: Floats) -> None:
        super().__init__(observation_space, len(mean))
        self.register_buffer("mean", torch.as_tensor(mean))
        self.register_buffer("variance", torch.as_tensor(variance))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """As `agents.learned.network.Network` does it."""
        scaled: torch.Tensor = (observations - self.mean) / torch.sqrt(self.variance)
        return scaled.clamp(-10.0, 10.0)


def make_model(algo: Algo, settings: Settings, env: AttackVecEnv, seed: int) -> BaseAlgorithm:
    """A learner that has not learned anything yet."""
    mean, variance = _statistics(env, seed)
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
    common |= settings.model_dump(include={"n_steps", "n_epochs", "gae_lambda", "clip_range", "ent_coef"})
    common["batch_size"] = min(settings.batch_size, settings.n_steps * settings.games)
    shape["log_std_init"] = settings.log_std_init
    if isinstance(settings, RecurrentPPOSettings):
        return RecurrentPPO("MlpLstmPolicy", env, policy_kwargs={**shape, "lstm_hidden_size": settings.lstm}, **common)
    return PPO("MlpPolicy", env, policy_kwargs=shape, **common)


def _statistics(env: AttackVecEnv, seed: int) -> tuple[Floats, Floats]:
    """Mean and variance of each entry of the observations of a whole game played at random."""
    rng, shape = np.random.default_rng(0), (env.num_envs, *(env.action_space.shape or ()))
    env.seed(seed)  # or the luck of these games, and so the same run, would be another one each time
    rows = [np.asarray(env.reset())]
    for _ in range(min(env.task.game.scenario.max_cycles, 500)):
        observation, *_ = env.step(rng.uniform(-1, 1, shape).astype(np.float32))
        rows.append(np.asarray(observation))
    seen = np.concatenate(rows)
    variance = seen.var(axis=0)
    return seen.mean(axis=0), np.where(variance < 1e-6, 1.0, variance).astype(np.float32)


def parameters_bytes(model: BaseAlgorithm) -> bytes:
    """All that the learner has learned, its optimisers included."""
    states, variables = model._get_torch_save_params()
    held = {name: recursive_getattr(model, name).state_dict() for name in states}
    loose = {name: recursive_getattr(model, name).data for name in variables}
    file = io.BytesIO()
    torch.save({"states": held, "variables": loose}, file)
    return file.getvalue()


def set_parameters(model: BaseAlgorithm, data: bytes) -> None:
    """Put back what `parameters_bytes` took; only tensors are read, and no code is run."""
    found = torch.load(io.BytesIO(data), weights_only=True)
    model.set_parameters(found["states"], exact_match=True)
    for name, value in found["variables"].items():
        recursive_setattr(model, f"{name}.data", value)


def network_of(model: BaseAlgorithm) -> Network:
    """The network that plays, without what only training needs."""
    policy: Any = model.policy
    lstm = None
    if isinstance(model, SAC):
        features, hidden, head = policy.actor.features_extractor, policy.actor.latent_pi, policy.actor.mu
    else:
        features, hidden, head = policy.features_extractor, policy.mlp_extractor.policy_net, policy.action_net
        lstm = getattr(policy, "lstm_actor", None)
    weights: dict[str, Floats] = {}
    if lstm is not None:
        weights["lstm.input"], weights["lstm.hidden"] = _array(lstm.weight_ih_l0), _array(lstm.weight_hh_l0)
        weights["lstm.bias"] = _array(lstm.bias_ih_l0 + lstm.bias_hh_l0)
    layers = [layer for layer in hidden if isinstance(layer, nn.Linear)]
    for i, layer in enumerate([*layers, head]):
        weights[f"layer{i}.weight"], weights[f"layer{i}.bias"] = _array(layer.weight), _array(layer.bias)
    architecture = Architecture(
        inputs=len(features.mean),
        outputs=head.out_features,
        hidden=tuple(layer.out_features for layer in layers),
        activation="relu" if isinstance(model, SAC) else "tanh",
        squash="tanh" if isinstance(model, SAC) else "clip",
        lstm=lstm.hidden_size if lstm is not None else 0,
    )
    return Network(architecture, _array(features.mean), _array(features.variance), weights)


def _array(tensor: torch.Tensor) -> Floats:
    array: Floats = tensor.detach().numpy().astype(np.float32)
    return array
