"""Small networks for PPO that the agents of a coalition share: one head for each kind of action,
for each provider.

Experience with one rater and one provider then applies to all, and an action depends only on
related observations. Each output has weights of its own in the first layer, so that agents can act
differently.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from roletrust_agents.learned.cards import InputField, observation_fields
from roletrust_agents.learned.network import Head
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.world.roster import Roster

_OWN = 0.5
"""Initial standard deviation of the weights of each output."""


def heads_of(task: AttackTask, inputs: int) -> tuple[Head, ...]:
    """Return a head for each kind of action: the qualities and the ratings of agents with the same
    role.

    A rating is about a provider, and a quality is about the agent itself. The head of an action
    observes every compromised agent: first the acting agent, then those of its role. Of each it
    observes the fields with one number and, of the fields with an entry for each provider, the
    entry of the provider in question. A quality also observes every rating of the agent. All heads
    observe all published trust at `"grey_box"`, and the whole state at `"white_box"`.

    Args:
        task: Task whose observations and actions the heads connect.
        inputs: Size of an observation.
    """
    fields = observation_fields(task.game.scenario, task.compromised, task.knowledge, inputs)
    kinds: dict[tuple[str, bool], dict[int, tuple[int, ...]]] = {}
    for output, (agent, provider, rates) in enumerate(_actions(task)):
        seen = tuple(_seen(fields, task.game.roster, _order(task, agent), provider, rates))
        kinds.setdefault((task.game.roster.role(agent), rates), {})[output] = seen
    return tuple(Head(outputs=tuple(head), sees=tuple(head.values())) for head in kinds.values())


def _actions(task: AttackTask) -> Iterator[tuple[str, int, bool]]:
    """Yield for each entry of an action its agent, the index of its provider, and whether it is a
    rating.
    """
    roster = task.game.roster
    for agent in task.compromised:
        if agent in roster.provider_names:
            yield agent, roster.provider_names.index(agent), False
        if agent in roster.rater_names:
            yield from ((agent, provider, True) for provider in range(roster.n_providers))


def _order(task: AttackTask, agent: str) -> list[str]:
    """Return the compromised agents, starting with the given one and those of its role."""
    at = task.compromised.index(agent)
    turned = task.compromised[at:] + task.compromised[:at]
    roles = task.game.roster.roles
    return sorted(turned, key=lambda name: roles[name] != roles[agent])


def _seen(
    fields: tuple[InputField, ...], roster: Roster, order: list[str], provider: int, rates: bool
) -> Iterator[int]:
    """Yield the indices of the observation that the head of an action observes."""
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
            if (
                len(entries) == 1
                or not agent
                or (agent == order[0] and not rates and not by_provider)
            ):
                yield from entries
            elif by_provider:
                yield entries[provider]


class _Head(nn.Module):
    """A head in torch, equal to that of `roletrust_agents.learned.network.Network`: (B, K) -> (B,
    outputs).
    """

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
        """Return the means of the actions."""
        x = self.layers[0](features[:, self.sees]) + self.own
        for layer in self.layers[1:]:
            x = layer(torch.tanh(x))
        means: torch.Tensor = x[..., 0]
        return means


def _opposites(rows: int, units: int) -> torch.Tensor:
    """Return random rows, in which every second row is the negative of the row before."""
    drawn = torch.randn(rows - rows // 2, units)
    return torch.stack([drawn, -drawn], dim=1).reshape(-1, units)[:rows]


class Heads(nn.Module):
    """The heads of an actor: (B, K) -> (B, A)."""

    order: torch.Tensor

    def __init__(self, heads: tuple[Head, ...], hidden: tuple[int, ...]) -> None:
        super().__init__()
        self.cards, self.heads = heads, [_Head(head, hidden) for head in heads]
        for h, head in enumerate(self.heads):
            self.add_module(f"head{h}", head)
        order = torch.tensor([place for head in heads for place in head.outputs]).argsort()
        self.register_buffer("order", order, persistent=False)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return the means of all actions."""
        return torch.cat([head(features) for head in self.heads], dim=1)[:, self.order]


class HeadsPolicy(ActorCriticPolicy):
    """Policy of PPO with heads for the actor, and one network for the critic that observes
    everything.

    Args:
        heads: Heads of the actor.
        head_hidden: Number of units in each hidden layer of the heads.
        args: Positional arguments of `ActorCriticPolicy`.
        kwargs: Keyword arguments of `ActorCriticPolicy`.
    """

    def __init__(
        self, *args: Any, heads: tuple[Head, ...], head_hidden: tuple[int, ...], **kwargs: Any
    ) -> None:
        self._heads, self.head_hidden = heads, head_hidden
        super().__init__(*args, **kwargs)

    def _build(self, lr_schedule: Any) -> None:
        super()._build(lr_schedule)
        self.action_net = Heads(self._heads, self.head_hidden)
        parameters: Any = {"lr": lr_schedule(1), **self.optimizer_kwargs}
        self.optimizer = self.optimizer_class(self.parameters(), **parameters)
