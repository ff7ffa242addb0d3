"""The network of a coalition for PPO of Stable-Baselines3, with noise that is held over an episode.

Smoothed trust averages over the rounds. Noise drawn anew in each round cancels there, and an attack
that differs from the present one in the same direction all the time is never tried. So a game keeps
its noise from its first round to its last.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import torch
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.preprocessing import get_action_dim
from torch import nn

from roletrust_agents.learned.deep_set import (
    ACCOUNT_UNITS,
    ALIKE,
    GAIN,
    TALKATIVE,
    DeepSet,
    DeepSetArchitecture,
)
from roletrust_env.game.accounts import ACCOUNT_FEATURES
from roletrust_env.game.coalition import FEATURES, Decision
from roletrust_env.game.coalition_task import CoalitionTask

_CLOCK = FEATURES.index("clock")
_SILENCE, _TREATMENT = (Decision._fields.index(name) for name in ("silence", "treatment"))
_NEAR_ZERO = 0.1  # scale of the last layer: the mean of an untrained network is near the truth


class Sight(NamedTuple):
    """What a coalition observes and decides.

    Attributes:
        raters: Number of raters, S.
        providers: Number of providers, P.
        own: Indices of its own providers, n of them.
        sizes: Kind of each decision, by its place in `Decision`, and the size of this part of an
            action, in its order.
    """

    raters: int
    providers: int
    own: tuple[int, ...]
    sizes: tuple[tuple[int, int], ...]

    @property
    def treats(self) -> bool:
        """Whether an action has the treatment of each rater by each own provider."""
        return any(kind == _TREATMENT for kind, _ in self.sizes)

    @property
    def wide(self) -> bool:
        """Whether an action has silence about each provider, or treatment."""
        return any(kind >= _SILENCE for kind, _ in self.sizes)

    def features(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the features of providers, (B, F, P), in observations, (B, F P) or longer."""
        size = len(FEATURES) * self.providers
        return observations[:, :size].reshape(len(observations), len(FEATURES), -1)

    def accounts(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the features of accounts, (B, S, n, A), in observations."""
        later = observations[:, len(FEATURES) * self.providers :]
        grid = later.reshape(len(later), len(ACCOUNT_FEATURES), self.raters, len(self.own))
        return grid.permute(0, 2, 3, 1)


class ProviderLayers(nn.Module):
    """The first two layers of a `DeepSet` in torch: features of providers, (B, F, P), to units, (B,
    P, units).
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
        second: torch.Tensor = torch.tanh(
            self.layer1(first) + self.mean(first.mean(dim=1, keepdim=True))
        )
        return second


class Treatment(nn.Module):
    """The treatment of a `DeepSet` in torch: features of accounts, (B, S, n, A), and of own
    providers, (B, n, F).
    """

    def __init__(self) -> None:
        super().__init__()
        self.layer0 = nn.Linear(len(ACCOUNT_FEATURES), ACCOUNT_UNITS)
        self.provider = nn.Linear(len(FEATURES), ACCOUNT_UNITS, bias=False)
        self.layer1, self.skip = (
            nn.Linear(ACCOUNT_UNITS, 1),
            nn.Linear(len(ACCOUNT_FEATURES), 1, bias=False),
        )
        for layer in (self.layer0, self.provider):
            _initialise(layer, 1.0)
        for layer in (self.layer1, self.skip):
            _initialise(layer, _NEAR_ZERO / GAIN)
        nn.init.constant_(self.layer1.bias, ALIKE)

    def forward(self, accounts: torch.Tensor, own: torch.Tensor) -> torch.Tensor:
        """Return the treatment before its last function, (B, S n)."""
        hidden = torch.tanh(self.layer0(accounts) + self.provider(own)[:, None])
        treatment: torch.Tensor = (self.layer1(hidden) + self.skip(accounts)).flatten(1)
        return treatment


class Actor(nn.Module):
    """A `DeepSet` in torch: observations, (B, K), to actions in [-1, 1], (B, A).

    Args:
        units: Number of units of each layer.
        sight: What is observed and decided.
    """

    def __init__(self, units: int, sight: Sight) -> None:
        super().__init__()
        self.sight, self.body = sight, ProviderLayers(units)
        self.layer2, self.skip = nn.Linear(units, 3), nn.Linear(len(FEATURES), 3, bias=False)
        for layer in (self.layer2, self.skip):
            _initialise(layer, _NEAR_ZERO / GAIN)
        if sight.wide:
            self.silence, self.silence_skip = (
                nn.Linear(units, 1),
                nn.Linear(len(FEATURES), 1, bias=False),
            )
            for layer in (self.silence, self.silence_skip):
                _initialise(layer, _NEAR_ZERO / GAIN)
            nn.init.constant_(self.silence.bias, TALKATIVE)
            self.treatment = Treatment()

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the mean of the actions."""
        features = self.sight.features(observations)
        units, seen = self.body(features), features.transpose(1, 2)
        lie, quality, gate = torch.tanh(GAIN * (self.layer2(units) + self.skip(seen))).unbind(-1)
        parts = [lie * (0.5 + 0.5 * gate), quality]
        if self.sight.wide:
            parts.append(torch.tanh(GAIN * (self.silence(units) + self.silence_skip(seen)))[..., 0])
        if self.sight.treats:
            treatment = self.treatment(
                self.sight.accounts(observations), seen[:, list(self.sight.own)]
            )
            parts.append(torch.tanh(GAIN * treatment))
        return torch.cat([parts[kind] for kind, _ in self.sight.sizes], dim=1)


class Critic(nn.Module):
    """A deep set with a mean over the providers at its end: observations, (B, K), to values, (B,
    1).

    Args:
        units: Number of units of each layer.
        sight: What is observed.
    """

    def __init__(self, units: int, sight: Sight) -> None:
        super().__init__()
        self.sight, self.body, self.value = sight, ProviderLayers(units), nn.Linear(units, 1)
        _initialise(self.value, _NEAR_ZERO)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the values."""
        value: torch.Tensor = self.value(self.body(self.sight.features(observations)).mean(dim=1))
        return value


class HeldGaussian(DiagGaussianDistribution):
    """A normal distribution of actions; its samples use the same noise from the first round of a
    game to its last.

    Log-probabilities are those of a normal distribution in each round.

    Attributes:
        begun: Whether the game of each row is in its first round, boolean, shape (B,); such a game
            gets new noise.
    """

    def __init__(self, action_dim: int) -> None:
        super().__init__(action_dim)
        self.begun = torch.zeros(0, dtype=torch.bool)
        self._noise = torch.zeros(0, action_dim)

    def sample(self) -> torch.Tensor:
        """Return actions with the noise of the games; if their number has changed, every game gets
        new noise.
        """
        mean: torch.Tensor = self.distribution.mean
        noise = torch.randn(mean.shape, dtype=mean.dtype, device=mean.device)
        same = self._noise.shape == mean.shape
        self._noise = torch.where(self.begun[:, None], noise, self._noise) if same else noise
        return mean + self.distribution.stddev * self._noise


class CoalitionPolicy(ActorCriticPolicy):
    """Policy of PPO that treats all providers alike, in a task with `observation="coalition"` or
    `"accounts"`.

    Args:
        sight: What the coalition observes and decides.
        units: Number of units of each layer of the actor.
        critic_units: Number of units of each layer of the critic.
        args: Positional arguments of `ActorCriticPolicy`.
        kwargs: Keyword arguments of `ActorCriticPolicy`, among them `log_std_init`.
    """

    def __init__(
        self, *args: Any, sight: Sight, units: int, critic_units: int, **kwargs: Any
    ) -> None:
        self._sight, self._units, self._critic_units = sight, units, critic_units
        super().__init__(*args, **{**kwargs, "net_arch": []})

    def _build(self, lr_schedule: Any) -> None:
        super()._build(lr_schedule)
        critic: Any = Critic(self._critic_units, self._sight)
        self.action_net, self.value_net = Actor(self._units, self._sight), critic
        kinds = 1 + max(1, *(kind for kind, _ in self._sight.sizes))
        self.log_std = nn.Parameter(
            torch.full((kinds,), float(self.log_std_init))
        )  # of each kind of decision
        self.action_dist = HeldGaussian(get_action_dim(self.action_space))
        parameters: Any = {"lr": lr_schedule(1), **self.optimizer_kwargs}
        self.optimizer = self.optimizer_class(self.parameters(), **parameters)

    def _get_action_dist_from_latent(self, latent_pi: torch.Tensor) -> HeldGaussian:
        """Return the distribution of actions. The latent features are the observations, as there
        are no layers before.

        The clock in them tells which games begin.
        """
        held: Any = self.action_dist
        actor: Any = self.action_net
        held.begun = self._sight.features(latent_pi)[:, _CLOCK, 0] == 0
        kinds = [kind for kind, size in self._sight.sizes for _ in range(size)]
        result: HeldGaussian = held.proba_distribution(actor(latent_pi), self.log_std[kinds])
        return result


def policy_arguments(
    task: CoalitionTask, units: int, critic_units: int, log_std_init: float
) -> dict[str, Any]:
    """Return the arguments of a `CoalitionPolicy` for a task, as PPO takes them for
    `policy_kwargs`.
    """
    coalition, roster = task.coalition, task.game.roster
    return {
        "sight": Sight(
            roster.n_raters,
            roster.n_providers,
            tuple(coalition.providers),
            tuple((Decision._fields.index(name), size) for name, size in coalition.sizes.items()),
        ),
        "units": units,
        "critic_units": critic_units,
        "log_std_init": log_std_init,
    }


def deep_set_of(policy: CoalitionPolicy, presence: DeepSet | None = None) -> DeepSet:
    """Return the network that decides as the policy does without noise.

    Args:
        policy: The policy.
        presence: Network that decides which identities in reserve are present; none is called if it
            is None.
    """
    tensors = dict(_tensors(policy))
    architecture = DeepSetArchitecture.of(
        len(tensors["layer0.bias"]), wide="silence.bias" in tensors
    )
    shapes = architecture.shapes().items()
    weights = (
        presence.weights
        if presence
        else {name: np.zeros(shape, np.float32) for name, shape in shapes}
    )
    learned = {
        name: np.array(tensor.detach().cpu().numpy(), np.float32)
        for name, tensor in tensors.items()
    }
    return DeepSet(architecture, {**weights, **learned})


def begin_with(policy: CoalitionPolicy, network: DeepSet) -> None:
    """Give a policy the weights of a network of the same architecture."""
    with torch.no_grad():
        for name, tensor in _tensors(policy):
            tensor.copy_(torch.as_tensor(network.weights[name]))


def _tensors(policy: CoalitionPolicy) -> Iterator[tuple[str, torch.Tensor]]:
    """Yield the weights of the actor with the names of `DeepSetArchitecture.shapes`."""
    actor: Any = policy.action_net
    body = actor.body
    yield "layer0.weight", body.layer0.weight
    yield "layer0.bias", body.layer0.bias
    yield "layer1.weight", body.layer1.weight
    yield "layer1.mean", body.mean.weight
    yield "layer1.bias", body.layer1.bias
    yield "layer2.weight", actor.layer2.weight
    yield "layer2.skip", actor.skip.weight
    yield "layer2.bias", actor.layer2.bias
    if actor.sight.wide:
        yield "silence.weight", actor.silence.weight
        yield "silence.skip", actor.silence_skip.weight
        yield "silence.bias", actor.silence.bias
        treatment = actor.treatment
        yield "treatment0.weight", treatment.layer0.weight
        yield "treatment0.provider", treatment.provider.weight
        yield "treatment0.bias", treatment.layer0.bias
        yield "treatment1.weight", treatment.layer1.weight
        yield "treatment1.skip", treatment.skip.weight
        yield "treatment1.bias", treatment.layer1.bias


def _initialise(layer: nn.Linear, scale: float) -> None:
    """Draw the weights as `roletrust_agents.learned.deep_set.random_weights` does, times a
    scale.
    """
    nn.init.normal_(layer.weight, std=scale * layer.in_features**-0.5)
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)
