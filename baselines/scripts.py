"""The scripted attackers as points to search through: defaults, a small grid, and a cube of all their parameters."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from baselines.provider.on_off import OnOff
from baselines.rater.bad_mouthing import BadMouthing
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.attack import AttackTask
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.randomness import Random

LONGEST = 12
"""The longest period of an on-off attack in the cube, in rounds."""

_BY_QUALITY, _BY_RATINGS = 4, 3  # parameters of a provider's and of a rater's attack

_GRID_ON_OFF = [
    OnOff(period=period, duty=duty, bad=bad)
    for period, duty, bad in itertools.product((2, 3, 5, 10), (0.25, 0.5, 0.75), (0.0, 0.5))
]
_GRID_LEVELS = (0.0, 0.25, 0.5, 0.75)


@dataclass(frozen=True)
class Both(Policy):
    """An agent with both roles that attacks by quality as one policy does, and by ratings as another."""

    serves: Policy
    rates: Policy
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    @property
    def reserve(self) -> int:  # type: ignore[override]
        """As many identities as either takes."""
        return max(self.serves.reserve, self.rates.reserve)

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """What the two remember. See `Policy.begin`."""
        return self.serves.begin(random, shape), self.rates.begin(random, shape)

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.quality`."""
        quality, mine = self.serves.quality(view, memory[0], random)
        return quality, (mine, memory[1])

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.ratings`."""
        ratings, mine = self.rates.ratings(view, memory[1], random)
        return ratings, (memory[0], mine)


@dataclass(frozen=True)
class SideBySide(Policy):
    """K policies side by side, in a batch of games of shape (K, G): the k-th plays in the k-th row.

    So that one batch tries many parameters of any attacker at once.
    """

    policies: tuple[Policy, ...]

    @property
    def attacks(self) -> frozenset[Channel]:  # type: ignore[override]
        """The channels on which any of them attacks."""
        return frozenset[Channel]().union(*(policy.attacks for policy in self.policies))

    @property
    def reserve(self) -> int:  # type: ignore[override]
        """As many identities as any takes."""
        return max(policy.reserve for policy in self.policies)

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """What each remembers. See `Policy.begin`."""
        return tuple(policy.begin(random, (*shape[:-2], shape[-1])) for policy in self.policies)

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.quality`."""
        rows = [
            policy.quality(ProviderView(*(field[..., k, :] for field in view)), memory[k], random)
            for k, policy in enumerate(self.policies)
        ]
        return _stack(rows)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.ratings`."""
        rows = [
            policy.ratings(RaterView(*(field[..., k, :] for field in view)), memory[k], random)
            for k, policy in enumerate(self.policies)
        ]
        return _stack(rows)


@dataclass(frozen=True)
class Scripts:
    """The scripted attacks that a task's compromised agents can play.

    A provider attacks on and off, a rater by bad-mouthing, an agent with both roles does both.

    Attributes:
        agents: the compromised agents; for each whether it provides, and whether it rates.
        victims: places of the honest providers on the provider axis.
    """

    agents: tuple[tuple[str, bool, bool], ...]
    victims: tuple[int, ...]

    @classmethod
    def of(cls, task: AttackTask) -> "Scripts":
        """The scripts of a task."""
        roster, bad = task.game.roster, {*task.compromised, *task.cast.attackers}
        agents = tuple((name, name in roster.provider_names, name in roster.rater_names) for name in task.compromised)
        return cls(agents, tuple(i for i, name in enumerate(roster.provider_names) if name not in bad))

    @property
    def size(self) -> int:
        """Number of parameters: each agent has its own."""
        return sum(_BY_QUALITY * provides + _BY_RATINGS * rates for _, provides, rates in self.agents)

    @property
    def default(self) -> dict[str, Policy]:
        """As in the paper: on and off round by round, and the constant note 0.5."""
        return self._all(OnOff(), BadMouthing())

    @property
    def grid(self) -> list[dict[str, Policy]]:
        """A few parameters of each attack, all in combination, the same for all agents of a role.

        Where both roles attack, one of them may also play honestly.
        """
        provides, rates = any(agent[1] for agent in self.agents), any(agent[2] for agent in self.agents)
        targets: list[tuple[int, ...] | None] = [None, self.victims[:1]] if len(self.victims) > 1 else [None]
        lies = [BadMouthing(level=level, targets=t) for level, t in itertools.product(_GRID_LEVELS, targets)]
        on_offs = _GRID_ON_OFF
        if provides and rates:
            on_offs, lies = [*on_offs, OnOff(duty=0)], [*lies, BadMouthing(lie="relative", level=0)]
        pairs = itertools.product(on_offs if provides else [OnOff()], lies if rates else [BadMouthing()])
        return [self._all(on_off, lie) for on_off, lie in pairs]

    def decode(self, point: Sequence[float] | Array) -> dict[str, Policy]:
        """The attack at a point of the cube [0, 1] ** size."""
        policies, at = {}, 0
        for name, provides, rates in self.agents:
            channels: list[Policy] = []
            if provides:
                channels.append(_on_off(point[at : at + _BY_QUALITY]))
                at += _BY_QUALITY
            if rates:
                channels.append(_bad_mouthing(point[at : at + _BY_RATINGS], self.victims))
                at += _BY_RATINGS
            policies[name] = channels[0] if len(channels) == 1 else Both(*channels)
        return policies

    def _all(self, on_off: OnOff, lie: BadMouthing) -> dict[str, Policy]:
        both = Both(on_off, lie)
        return {
            name: both if provides and rates else on_off if provides else lie for name, provides, rates in self.agents
        }


def side_by_side(attacks: Sequence[Mapping[str, Policy]]) -> dict[str, Policy]:
    """K attacks as one, for a batch of games of shape (K, G)."""
    return {name: SideBySide(tuple(attack[name] for attack in attacks)) for name in attacks[0]}


def describe(attack: Mapping[str, Policy]) -> str:
    """An attack in a few words, agents that do the same together, parameters with their usual value left out."""
    agents: dict[str, list[str]] = {}
    for name, policy in attack.items():
        agents.setdefault(_words(policy), []).append(name)
    return "; ".join(f"{', '.join(names)}: {words}" for words, names in agents.items())


def _words(policy: Policy) -> str:
    if isinstance(policy, Both):
        return f"{_words(policy.serves)} and {_words(policy.rates)}"
    if isinstance(policy, OnOff):
        return f"on-off {policy.period} rounds, {policy.duty:.2g} of them at {policy.bad:.2g}, else {policy.good:.2g}"
    if isinstance(policy, BadMouthing):
        whom = "all" if policy.targets is None else f"{len(policy.targets)}"
        return f"rates {whom} {f'{policy.level:.2g}' if policy.lie == 'constant' else f'{policy.level:.2g} too low'}"
    return str(policy)


def _on_off(x: Sequence[float] | Array) -> OnOff:
    period = 1 + min(int(x[0] * LONGEST), LONGEST - 1)
    return OnOff(period=period, duty=float(x[1]), bad=float(x[2]), good=float(x[3]))


def _bad_mouthing(x: Sequence[float] | Array, victims: tuple[int, ...]) -> BadMouthing:
    number = 1 + min(int(x[2] * len(victims)), len(victims) - 1)
    lie = "constant" if x[0] < 0.5 else "relative"
    return BadMouthing(lie=lie, level=float(x[1]), targets=victims[:number] or None)  # type: ignore[arg-type]


def _stack(rows: Sequence[tuple[Array, Any]]) -> tuple[Array, Any]:
    """What K policies did, (..., G) each, as (..., K, G), and what they remember."""
    done = [row[0] for row in rows]
    stacked = np.stack(done, axis=-2) if isinstance(done[0], np.ndarray) else namespace(done[0]).stack(done, axis=-2)
    return stacked, tuple(row[1] for row in rows)
