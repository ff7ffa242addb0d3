"""Policies that are made of others: one for each role of an agent, and many side by side in a batch."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.by_channel import ByChannel
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.game.views import IdentityView, ProviderView, RaterView
from roletrust_env.randomness import Random

View = TypeVar("View", ProviderView, RaterView, IdentityView)


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

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """As the one has it that takes identities, the one it serves by if both do. See `Policy.presence`."""
        serves, rates = memory
        if self.serves.reserve:
            there, serves = self.serves.presence(view, serves, random)
        else:
            there, rates = self.rates.presence(view, rates, random)
        return there, (serves, rates)


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
        rows = [p.quality(_row(view, k), memory[k], random) for k, p in enumerate(self.policies)]
        return _stack(rows)

    def treats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """See `Policy.treats`."""
        rows = [p.treats(_row(view, k), memory[k], random) for k, p in enumerate(self.policies)]
        return _stack_unusual(rows, 0 * view.ratings[..., 0, :] + 1)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.ratings`."""
        rows = [p.ratings(_row(view, k), memory[k], random) for k, p in enumerate(self.policies)]
        return _stack(rows)

    def withholds(self, view: RaterView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """See `Policy.withholds`."""
        rows = [p.withholds(_row(view, k), memory[k], random) for k, p in enumerate(self.policies)]
        return _stack_unusual(rows, view.awaiting[..., 0, :] & False)

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Policy.presence`."""
        rows = [p.presence(_row(view, k), memory[k], random) for k, p in enumerate(self.policies)]
        return _stack(rows)


def side_by_side(attacks: Sequence[Mapping[str, Policy]]) -> dict[str, Policy]:
    """K attacks as one, for a batch of games of shape (K, G)."""
    return {name: SideBySide(tuple(attack[name] for attack in attacks)) for name in attacks[0]}


def _row(view: View, k: int) -> View:
    """What the k-th policy sees, of a batch of games of shape (K, G)."""
    return type(view)(*(field[..., k, :] for field in view))


def _stack_unusual(rows: Sequence[tuple[Array | None, Any]], usual: Array) -> tuple[Array | None, Any]:
    """The same of what few do; who gave None does the usual. None if all do."""
    if all(done is None for done, _ in rows):
        return None, tuple(memory for _, memory in rows)
    return _stack([(usual if done is None else done, memory) for done, memory in rows])


def _stack(rows: Sequence[tuple[Array, Any]]) -> tuple[Array, Any]:
    """What K policies did, (..., G) each, as (..., K, G), and what they remember."""
    done = [row[0] for row in rows]
    stacked = np.stack(done, axis=-2) if isinstance(done[0], np.ndarray) else namespace(done[0]).stack(done, axis=-2)
    return stacked, tuple(row[1] for row in rows)
