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
from experiments.training.heads import HeadsPolicy, heads_of
from roletrust_env.envs.sb3 import AttackVecEnv
from roletrust_env.errors import explain
from roletrust_env.game.attack import AttackTask

Algo = Literal["ppo", "sac", "recurrent-ppo"]
Natural = Annotated[int, Field(ge=1, le=10_000_000)]
Rate = Annotated[float, Field(gt=0, le=1)]
Discount = Annotated[float, Field(ge=0, le=1)]
LogStd = Annotated[float, Field(ge=-10, le=2)]


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


class OnPolicySettings(_Settings):
    """Of PPO of either kind: many games, short rollouts, and a spread of the actions that starts narrow."""

    n_steps: Natural = 25
    """Rounds of each game between two updates."""
    n_epochs: Natural = 10
    gae_lambda: Discount = 0.95
    clip_range: Rate = 0.2
    ent_coef: Annotated[float, Field(ge=0, le=1)] = 0.0
    log_std_init: LogStd = -0.5
    log_std_last: LogStd | None = None
    """Below which the spread has to be at last: its logarithm's limit falls in a straight line. None is no limit."""


class PPOSettings(OnPolicySettings):
    """Of PPO."""

    steps: Natural = 800_000
    games: Natural = 256
    batch_size: Natural = 1600
    heads: Annotated[tuple[Natural, ...], Field(max_length=8)] = ()
    """Units of each hidden layer of small networks in the actor's place, see `experiments.training.heads`."""


class RecurrentPPOSettings(OnPolicySettings):
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

_NORMALISING_GAMES = 16

TUNED: dict[tuple[str, str], dict[str, Any]] = {
    # Many actions at once: shared heads, longer, in fewer passes over each rollout, each of which may change more, and
    # with an eye on the next ten rounds only. A lie is worth most where it is exact, so the spread must go.
    ("RoleTrust/CollusionAttack-v0", "ppo"): {
        "steps": 1_900_000,
        "gamma": 0.9,
        "n_epochs": 5,
        "learning_rate": 0.0015,
        "clip_range": 0.4,
        "log_std_last": -4.0,
        "heads": (32, 32),
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
    common |= settings.model_dump(include={"n_steps", "n_epochs", "gae_lambda", "clip_range", "ent_coef"})
    common["batch_size"] = min(settings.batch_size, settings.n_steps * settings.games)
    shape["log_std_init"] = settings.log_std_init
    if isinstance(settings, RecurrentPPOSettings):
        return RecurrentPPO("MlpLstmPolicy", env, policy_kwargs={**shape, "lstm_hidden_size": settings.lstm}, **common)
    if not settings.heads:
        return PPO("MlpPolicy", env, policy_kwargs=shape, **common)
    shape |= {"net_arch": {"pi": [], "vf": shape["net_arch"]}, "head_hidden": settings.heads}
    shape["heads"] = heads_of(env.task, len(mean))
    return PPO(HeadsPolicy, env, policy_kwargs=shape, **common)


def normalising_rounds(task: AttackTask) -> int:
    """Rounds, of all games together, that are played before training to normalise the observations by."""
    return _NORMALISING_GAMES * min(task.game.scenario.max_cycles, 500)


def _statistics(task: AttackTask, seed: int) -> tuple[Floats, Floats]:
    """Mean and variance of each entry of the observations of games played at random."""
    env, rng = AttackVecEnv(task, _NORMALISING_GAMES, seed=seed), np.random.default_rng(seed)
    rows, shape = [np.asarray(env.reset())], (_NORMALISING_GAMES, task.action_size)
    for _ in range(normalising_rounds(task) // _NORMALISING_GAMES):
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
    if isinstance(policy, HeadsPolicy):
        return _network_of_heads(policy)
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


def _network_of_heads(policy: HeadsPolicy) -> Network:
    features: Any = policy.features_extractor
    actor: Any = policy.action_net
    weights = {name: _array(weight) for name, weight in actor.named_parameters()}  # named as in the architecture
    outputs = sum(len(head.outputs) for head in actor.cards)
    architecture = Architecture(
        inputs=len(features.mean), outputs=outputs, hidden=policy.head_hidden, heads=actor.cards
    )
    return Network(architecture, _array(features.mean), _array(features.variance), weights)


def _array(tensor: torch.Tensor) -> Floats:
    array: Floats = tensor.detach().numpy().astype(np.float32)
    return array
