"""Policies that are made of others: one for each role of an agent, and many side by side in a batch."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from baselines.channels import ByChannel
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.randomness import Random


@dataclass(frozen=True)
class Both(ByChannel):
    """An agent with both roles that attacks by quality as one policy does, and by ratings as another."""

    serves: Policy
    rates: Policy
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    @property
    def reserve(self) -> int:  # type: ignore[override]
        """As many identities as either takes."""
        return max(self.serves.reserve, self.rates.reserve)


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


def side_by_side(attacks: Sequence[Mapping[str, Policy]]) -> dict[str, Policy]:
    """K attacks as one, for a batch of games of shape (K, G)."""
    return {name: SideBySide(tuple(attack[name] for attack in attacks)) for name in attacks[0]}


def _stack(rows: Sequence[tuple[Array, Any]]) -> tuple[Array, Any]:
    """What K policies did, (..., G) each, as (..., K, G), and what they remember."""
    done = [row[0] for row in rows]
    stacked = np.stack(done, axis=-2) if isinstance(done[0], np.ndarray) else namespace(done[0]).stack(done, axis=-2)
    return stacked, tuple(row[1] for row in rows)
