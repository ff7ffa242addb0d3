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


class TwoInputs(nn.Linear):
    """A linear layer of two inputs; only the first one has a bias."""

    def __init__(self, first: int, second: int, outputs: int) -> None:
        super().__init__(first, outputs)
        self.second = nn.Linear(second, outputs, bias=False)

    def forward(self, first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:  # type: ignore[override]
        """Return the outputs."""
        outputs: torch.Tensor = super().forward(first) + self.second(second)
        return outputs


class ProviderLayers(nn.Module):
    """The first two layers of a `DeepSet` in torch."""

    def __init__(self, units: int) -> None:
        super().__init__()
        self.layer0 = nn.Linear(len(FEATURES), units)
        self.layer1 = TwoInputs(units, units, units)
        for layer in (self.layer0, self.layer1):
            _initialise(layer, 1.0)

    def units(self, seen: torch.Tensor) -> torch.Tensor:
        """Return the units of the second layer, (B, P, units), for features, (B, P, F)."""
        first = torch.tanh(self.layer0(seen))
        second: torch.Tensor = torch.tanh(self.layer1(first, first.mean(dim=1, keepdim=True)))
        return second


class Actor(ProviderLayers):
    """A `DeepSet` in torch: observations, (B, K), to actions in [-1, 1], (B, A).

    Args:
        units: Number of units of each layer.
        sight: What is observed and decided.
    """

    def __init__(self, units: int, sight: Sight) -> None:
        super().__init__(units)
        self.sight, scale = sight, _NEAR_ZERO / GAIN
        self.layer2 = TwoInputs(units, len(FEATURES), 3)
        _initialise(self.layer2, scale)
        if sight.wide:
            self.silence = TwoInputs(units, len(FEATURES), 1)
            _initialise(self.silence, scale)
            nn.init.constant_(self.silence.bias, TALKATIVE)
            self.treatment0 = TwoInputs(len(ACCOUNT_FEATURES), len(FEATURES), ACCOUNT_UNITS)
            self.treatment1 = TwoInputs(ACCOUNT_UNITS, len(ACCOUNT_FEATURES), 1)
            _initialise(self.treatment0, 1.0)
            _initialise(self.treatment1, scale)
            nn.init.constant_(self.treatment1.bias, ALIKE)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the mean of the actions."""
        seen = self.sight.features(observations).transpose(1, 2)
        units = self.units(seen)
        lie, quality, gate = torch.tanh(GAIN * self.layer2(units, seen)).unbind(-1)
        parts = [lie * (0.5 + 0.5 * gate), quality]
        if self.sight.wide:
            parts.append(torch.tanh(GAIN * self.silence(units, seen))[..., 0])
        if self.sight.treats:
            accounts, own = self.sight.accounts(observations), seen[:, list(self.sight.own)]
            hidden = torch.tanh(self.treatment0(accounts, own[:, None]))
            parts.append(torch.tanh(GAIN * self.treatment1(hidden, accounts).flatten(1)))
        return torch.cat([parts[kind] for kind, _ in self.sight.sizes], dim=1)


class Critic(ProviderLayers):
    """A deep set with a mean over the providers at its end: observations, (B, K), to values, (B,
    1).

    Args:
        units: Number of units of each layer.
        sight: What is observed.
    """

    def __init__(self, units: int, sight: Sight) -> None:
        super().__init__(units)
        self.sight, self.value = sight, nn.Linear(units, 1)
        _initialise(self.value, _NEAR_ZERO)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the values."""
        seen = self.sight.features(observations).transpose(1, 2)
        value: torch.Tensor = self.value(self.units(seen).mean(dim=1))
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
    for name, tensor in policy.action_net.named_parameters():
        layer, _, weight = name.partition(".")
        second = {"layer1": "mean", "treatment0": "provider"}.get(layer, "skip")
        yield (f"{layer}.{second}" if weight == "second.weight" else name), tensor


def _initialise(layer: nn.Linear, scale: float) -> None:
    """Draw the weights as `roletrust_agents.learned.deep_set.random_weights` does, times a
    scale.
    """
    nn.init.normal_(layer.weight, std=scale * layer.in_features**-0.5)
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)
    if isinstance(layer, TwoInputs):
        _initialise(layer.second, scale)
