"""Small networks that a coalition's agents share, for PPO: one for every kind of action, asked about each provider.

What is learned of one rater and one provider then holds for all, and an action does not depend on what has nothing to
do with it. That agents do not all do the same, each output has weights of its own in the first layer.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import torch
from roletrust_agents.learned.cards import InputField, observation_fields
from roletrust_agents.learned.network import Head
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from roletrust_env.game.attack_task import AttackTask
from roletrust_env.world.roster import Roster

_OWN = 0.5
"""Standard deviation, at first, of what is an output's own."""


def heads_of(task: AttackTask, inputs: int) -> tuple[Head, ...]:
    """A head for each kind of action: the qualities, and the ratings, of agents with the same role.

    An action is about a provider, a quality about the agent itself. It sees every compromised agent, its own first and
    then those of its role: of each the fields that are one number, and of those that a rater has for every provider
    the entry of that one. A quality also sees every rater's rating of it. All see all of what is published to
    `"grey_box"`, and of the state that `"white_box"` sees.

    Args:
        task: whose observations and actions they are.
        inputs: size of an observation.
    """
    fields = observation_fields(task.game.scenario, task.compromised, task.knowledge, inputs)
    kinds: dict[tuple[str, bool], dict[int, tuple[int, ...]]] = {}
    for output, (agent, provider, rates) in enumerate(_actions(task)):
        seen = tuple(_seen(fields, task.game.roster, _order(task, agent), provider, rates))
        kinds.setdefault((task.game.roster.role(agent), rates), {})[output] = seen
    return tuple(Head(outputs=tuple(head), sees=tuple(head.values())) for head in kinds.values())


def _actions(task: AttackTask) -> Iterator[tuple[str, int, bool]]:
    """Of each entry of an action: whose it is, the place of the provider that it is about, whether it is a rating."""
    roster = task.game.roster
    for agent in task.compromised:
        if agent in roster.provider_names:
            yield agent, roster.provider_names.index(agent), False
        if agent in roster.rater_names:
            yield from ((agent, provider, True) for provider in range(roster.n_providers))


def _order(task: AttackTask, agent: str) -> list[str]:
    """The compromised agents, beginning with one and those of its role, in turn."""
    at = task.compromised.index(agent)
    turned = task.compromised[at:] + task.compromised[:at]
    roles = task.game.roster.roles
    return sorted(turned, key=lambda name: roles[name] != roles[agent])


def _seen(
    fields: tuple[InputField, ...], roster: Roster, order: list[str], provider: int, rates: bool
) -> Iterator[int]:
    """The places of what an action sees in the observation."""
    places, at = {}, 0
    for field in fields:
        places[field.name] = range(at, at + field.size)
        at += field.size
    for agent in (*order, ""):
        for name, entries in places.items():
            owner = name.partition(".")[0]
            if (owner if owner in order else "") != agent:
                continue
            by_provider = roster.roles.get(owner) == "SR" or ".rater." in name
            if len(entries) == 1 or not agent or (agent == order[0] and not rates and not by_provider):
                yield from entries
            elif by_provider:
                yield entries[provider]


class _Head(nn.Module):
    """A head in torch, as `roletrust_agents.learned.network.Network` has it: (B, K) -> (B, its outputs)."""

    sees: torch.Tensor

    def __init__(self, head: Head, hidden: tuple[int, ...]) -> None:
        super().__init__()
        self.layers = [nn.Linear(*pair) for pair in pairwise((len(head.sees[0]), *hidden, 1))]
        for i, layer in enumerate(self.layers):
            nn.init.orthogonal_(layer.weight, 2**0.5 if i < len(hidden) else 0.01)
            nn.init.zeros_(layer.bias)
            self.add_module(f"layer{i}", layer)
        self.own = nn.Parameter(_OWN * _opposites(len(head.outputs), hidden[0]))
        self.register_buffer("sees", torch.tensor(head.sees), persistent=False)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """The means of its actions."""
        x = self.layers[0](features[:, self.sees]) + self.own
        for layer in self.layers[1:]:
            x = layer(torch.tanh(x))
        means: torch.Tensor = x[..., 0]
        return means


def _opposites(rows: int, units: int) -> torch.Tensor:
    """Random rows, every other one the opposite of the one before."""
    drawn = torch.randn(rows - rows // 2, units)
    return torch.stack([drawn, -drawn], dim=1).reshape(-1, units)[:rows]


class Heads(nn.Module):
    """All heads of an actor: (B, K) -> (B, A)."""

    order: torch.Tensor

    def __init__(self, heads: tuple[Head, ...], hidden: tuple[int, ...]) -> None:
        super().__init__()
        self.cards, self.heads = heads, [_Head(head, hidden) for head in heads]
        for h, head in enumerate(self.heads):
            self.add_module(f"head{h}", head)
        order = torch.tensor([place for head in heads for place in head.outputs]).argsort()
        self.register_buffer("order", order, persistent=False)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """The means of all actions."""
        return torch.cat([head(features) for head in self.heads], dim=1)[:, self.order]


class HeadsPolicy(ActorCriticPolicy):
    """PPO's policy with heads for the actor; the critic is one network that sees everything.

    Args:
        heads: of the actor.
        head_hidden: units of their hidden layers.
        args: of `ActorCriticPolicy`.
        kwargs: of `ActorCriticPolicy`.
    """

    def __init__(self, *args: Any, heads: tuple[Head, ...], head_hidden: tuple[int, ...], **kwargs: Any) -> None:
        self._heads, self.head_hidden = heads, head_hidden
        super().__init__(*args, **kwargs)

    def _build(self, lr_schedule: Any) -> None:
        super()._build(lr_schedule)
        self.action_net = Heads(self._heads, self.head_hidden)
        parameters: Any = {"lr": lr_schedule(1), **self.optimizer_kwargs}
        self.optimizer = self.optimizer_class(self.parameters(), **parameters)
