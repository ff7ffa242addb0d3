"""Composite policies: one policy for each role of an agent, and many policies side by side in a batch."""

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
    """A policy for an SR+SP agent: it serves by one policy and rates by another.

    Attributes:
        serves: Policy for services.
        rates: Policy for ratings.
    """

    serves: Policy
    rates: Policy
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings"})

    @property
    def reserve(self) -> int:  # type: ignore[override]
        """Number of identities in reserve that the policy needs: that of the part that needs more."""
        return max(self.serves.reserve, self.rates.reserve)

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Let the part that uses identities decide, or the serving part if both do. See `Policy.presence`."""
        serves, rates = memory
        if self.serves.reserve:
            there, serves = self.serves.presence(view, serves, random)
        else:
            there, rates = self.rates.presence(view, rates, random)
        return there, (serves, rates)


@dataclass(frozen=True)
class SideBySide(Policy):
    """K policies side by side in a batch of games of shape (K, G): the k-th plays in the k-th row.

    One batch then tries many parameters of an attack at once.

    Attributes:
        policies: Policies of the rows.
    """

    policies: tuple[Policy, ...]

    @property
    def attacks(self) -> frozenset[Channel]:  # type: ignore[override]
        """Channels on which any of the policies attacks."""
        return frozenset[Channel]().union(*(policy.attacks for policy in self.policies))

    @property
    def reserve(self) -> int:  # type: ignore[override]
        """Number of identities in reserve that the policies need: the largest of them."""
        return max(policy.reserve for policy in self.policies)

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return the memories of the policies. See `Policy.begin`."""
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
    """Return K attacks as one attack, for a batch of games of shape (K, G)."""
    return {name: SideBySide(tuple(attack[name] for attack in attacks)) for name in attacks[0]}


def _row(view: View, k: int) -> View:
    """Return the view of the k-th policy in a batch of games of shape (K, G)."""
    return type(view)(*(field[..., k, :] for field in view))


def _stack_unusual(rows: Sequence[tuple[Array | None, Any]], usual: Array) -> tuple[Array | None, Any]:
    """Stack actions on a channel that few policies use. None stands for the usual action; all None stay None."""
    if all(done is None for done, _ in rows):
        return None, tuple(memory for _, memory in rows)
    return _stack([(usual if done is None else done, memory) for done, memory in rows])


def _stack(rows: Sequence[tuple[Array, Any]]) -> tuple[Array, Any]:
    """Stack the actions of K policies, (..., G) each, to (..., K, G), and return their memories."""
    done = [row[0] for row in rows]
    stacked = np.stack(done, axis=-2) if isinstance(done[0], np.ndarray) else namespace(done[0]).stack(done, axis=-2)
    return stacked, tuple(row[1] for row in rows)
