"""The network of a coalition for PPO of Stable-Baselines3, with noise that is held over an episode.

Smoothed trust averages over the rounds. Noise drawn anew in each round cancels there, and an attack that differs from
the present one in the same direction all the time is never tried. So a game keeps its noise from its first round to
its last.
"""

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.preprocessing import get_action_dim
from torch import nn

from roletrust_agents.learned.deep_set import GAIN, DeepSet, DeepSetArchitecture
from roletrust_env.game.coalition import FEATURES, Coalition

_CLOCK = FEATURES.index("clock")
_NEAR_ZERO = 0.1  # scale of the last layer: the mean of an untrained network is near the truth


class ProviderLayers(nn.Module):
    """The first two layers of a `DeepSet` in torch: features of providers, (B, F, P), to units, (B, P, units).

    Args:
        units: Number of units of each layer.
    """

    def __init__(self, units: int) -> None:
        super().__init__()
        self.layer0 = nn.Linear(len(FEATURES), units)
        self.layer1 = nn.Linear(units, units)
        self.mean = nn.Linear(units, units, bias=False)
        for layer in (self.layer0, self.layer1, self.mean):
            _initialise(layer, 1.0)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return the units of the second layer for each provider."""
        first = torch.tanh(self.layer0(features.transpose(1, 2)))
        second: torch.Tensor = torch.tanh(self.layer1(first) + self.mean(first.mean(dim=1, keepdim=True)))
        return second


class Actor(nn.Module):
    """A `DeepSet` in torch: observations, (B, F P), to actions in [-1, 1], (B, A).

    Args:
        units: Number of units of each layer.
        rates: Whether the coalition rates, so that an action has a lie about each provider.
        provides: Whether it provides, so that an action has a quality of each provider.
    """

    def __init__(self, units: int, rates: bool, provides: bool) -> None:
        super().__init__()
        self.channels = [channel for channel, there in enumerate((rates, provides)) if there]
        self.body = ProviderLayers(units)
        self.layer2, self.skip = nn.Linear(units, 3), nn.Linear(len(FEATURES), 3, bias=False)
        for layer in (self.layer2, self.skip):
            _initialise(layer, _NEAR_ZERO / GAIN)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the mean of the actions."""
        features = _by_provider(observations)
        outputs = torch.tanh(GAIN * (self.layer2(self.body(features)) + self.skip(features.transpose(1, 2))))
        lie, quality, gate = outputs.unbind(-1)
        both = torch.stack([lie * (0.5 + 0.5 * gate), quality], dim=1)
        return both[:, self.channels].flatten(1)


class Critic(nn.Module):
    """A deep set with a mean over the providers at its end: observations, (B, F P), to values, (B, 1).

    Args:
        units: Number of units of each layer.
    """

    def __init__(self, units: int) -> None:
        super().__init__()
        self.body, self.value = ProviderLayers(units), nn.Linear(units, 1)
        _initialise(self.value, _NEAR_ZERO)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the values."""
        value: torch.Tensor = self.value(self.body(_by_provider(observations)).mean(dim=1))
        return value


class HeldGaussian(DiagGaussianDistribution):
    """A normal distribution of actions; its samples use the same noise from the first round of a game to its last.

    Log-probabilities are those of a normal distribution in each round.

    Attributes:
        begun: Whether the game of each row is in its first round, boolean, shape (B,); such a game gets new noise.
    """

    def __init__(self, action_dim: int) -> None:
        super().__init__(action_dim)
        self.begun = torch.zeros(0, dtype=torch.bool)
        self._noise = torch.zeros(0, action_dim)

    def sample(self) -> torch.Tensor:
        """Return actions with the noise of the games; if their number has changed, every game gets new noise."""
        mean: torch.Tensor = self.distribution.mean
        noise = torch.randn(mean.shape, dtype=mean.dtype, device=mean.device)
        same = self._noise.shape == mean.shape
        self._noise = torch.where(self.begun[:, None], noise, self._noise) if same else noise
        return mean + self.distribution.stddev * self._noise


class CoalitionPolicy(ActorCriticPolicy):
    """Policy of PPO that treats all providers alike, in a task with `observation="coalition"`.

    Args:
        rates: Whether the coalition rates.
        provides: Whether it provides.
        units: Number of units of each layer of the actor.
        critic_units: Number of units of each layer of the critic.
        args: Positional arguments of `ActorCriticPolicy`.
        kwargs: Keyword arguments of `ActorCriticPolicy`, among them `log_std_init`.
    """

    def __init__(self, *args: Any, rates: bool, provides: bool, units: int, critic_units: int, **kwargs: Any) -> None:
        self._shape = (units, rates, provides)
        self._critic_units = critic_units
        super().__init__(*args, **{**kwargs, "net_arch": []})

    def _build(self, lr_schedule: Any) -> None:
        super()._build(lr_schedule)
        critic: Any = Critic(self._critic_units)
        self.action_net, self.value_net = Actor(*self._shape), critic
        self.log_std = nn.Parameter(torch.full((2,), float(self.log_std_init)))  # of lies and of qualities
        self.action_dist = HeldGaussian(get_action_dim(self.action_space))
        parameters: Any = {"lr": lr_schedule(1), **self.optimizer_kwargs}
        self.optimizer = self.optimizer_class(self.parameters(), **parameters)

    def _get_action_dist_from_latent(self, latent_pi: torch.Tensor) -> HeldGaussian:
        """Return the distribution of actions. The latent features are the observations, as there are no layers before.

        The clock in them tells which games begin.
        """
        held: Any = self.action_dist
        actor: Any = self.action_net
        mean = actor(latent_pi)
        held.begun = _by_provider(latent_pi)[:, _CLOCK, 0] == 0
        spread = self.log_std[actor.channels].repeat_interleave(mean.shape[1] // len(actor.channels))
        result: HeldGaussian = held.proba_distribution(mean, spread)
        return result


def policy_arguments(coalition: Coalition, units: int, critic_units: int, log_std_init: float) -> dict[str, Any]:
    """Return the arguments of a `CoalitionPolicy` for a coalition, as PPO takes them for `policy_kwargs`."""
    return {
        "rates": coalition.rates,
        "provides": bool(coalition.providers),
        "units": units,
        "critic_units": critic_units,
        "log_std_init": log_std_init,
    }


def deep_set_of(policy: CoalitionPolicy, presence: DeepSet | None = None) -> DeepSet:
    """Return the network that decides as the policy does without noise.

    Args:
        policy: The policy.
        presence: Network that decides which identities in reserve are present; none is called if it is None.
    """
    tensors = _tensors(policy)
    architecture = DeepSetArchitecture(units=len(tensors["layer0.bias"]))
    shapes = architecture.shapes().items()
    weights = presence.weights if presence else {name: np.zeros(shape, np.float32) for name, shape in shapes}
    learned = {name: np.array(tensor.detach().cpu().numpy(), np.float32) for name, tensor in tensors.items()}
    return DeepSet(architecture, {**weights, **learned})


def begin_with(policy: CoalitionPolicy, network: DeepSet) -> None:
    """Give a policy the weights of a network of the same architecture."""
    with torch.no_grad():
        for name, tensor in _tensors(policy).items():
            tensor.copy_(torch.as_tensor(network.weights[name]))


def _tensors(policy: CoalitionPolicy) -> dict[str, torch.Tensor]:
    """Return the weights of the actor by the names of `DeepSetArchitecture.shapes`."""
    actor: Any = policy.action_net
    body = actor.body
    return {
        "layer0.weight": body.layer0.weight,
        "layer0.bias": body.layer0.bias,
        "layer1.weight": body.layer1.weight,
        "layer1.mean": body.mean.weight,
        "layer1.bias": body.layer1.bias,
        "layer2.weight": actor.layer2.weight,
        "layer2.skip": actor.skip.weight,
        "layer2.bias": actor.layer2.bias,
    }


def _initialise(layer: nn.Linear, scale: float) -> None:
    """Draw the weights as `roletrust_agents.learned.deep_set.random_weights` does, times a scale."""
    nn.init.normal_(layer.weight, std=scale * layer.in_features**-0.5)
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)


def _by_provider(observations: torch.Tensor) -> torch.Tensor:
    """Return observations, (B, F P), as features of providers, (B, F, P)."""
    return observations.reshape(len(observations), len(FEATURES), -1)
