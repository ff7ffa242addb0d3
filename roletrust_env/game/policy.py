"""Policies: how an agent plays, as functions of what it may see."""

import re
from typing import Any, ClassVar, Literal

from roletrust_env.arrays import Array
from roletrust_env.game.views import AgentView, IdentityView, ProviderView, RaterView
from roletrust_env.randomness import Random

Channel = Literal["quality", "treatment", "ratings", "silence", "presence"]
"""Decision of an agent. `"treatment"` is the share of quality for each rater, `"silence"` the ratings it withholds."""


class Policy:
    """The behaviour of an agent. This class plays honestly; subclasses override what they do differently.

    A policy is immutable. Its memory from round to round is separate, and its methods return the new memory. A policy
    sees one agent. Further axes of the view (agents that share the policy, then the batch) are carried along, so that
    one object plays in a PettingZoo loop, in one game and in a million.

    Attributes:
        attacks: Channels on which the policy does not play honestly, see `Channel`.
        reserve: Number of identities in reserve that the policy needs.
    """

    attacks: ClassVar[frozenset[Channel]] = frozenset()
    reserve: int = 0

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return the memory before the first round, for agents and a batch of this shape; None without a memory."""
        return None

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the quality of the next service, shape (...), in [0, 1], and the new memory."""
        return 0 * view.trust + 1, memory

    def treats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """Return the share of that quality for each rater, shape (S, ...), in [0, 1], and the new memory.

        None serves all raters alike.

        Called after `quality` in a `JointPolicy`; the faces of PettingZoo and a task's action have no such channel.
        """
        return None, memory

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the ratings, shape (P, ...), in [0, 1], and the new memory.

        Ratings of services that the rater did not receive are ignored.
        """
        return view.service, memory

    def withholds(self, view: RaterView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """Return which ratings are withheld, boolean, shape (P, ...), and the new memory; None sends all ratings.

        Called after `ratings` in a `JointPolicy`; the faces of PettingZoo and a task's action have no such channel.
        """
        return None, memory

    def both(self, view: AgentView, memory: Any, random: Random) -> tuple[Array, Array, Any]:
        """Return quality and ratings of an SR+SP agent, and the new memory. By default each role decides alone."""
        quality, memory = self.quality(view.provider, memory, random)
        ratings, memory = self.ratings(view.rater, memory, random)
        return quality, ratings, memory

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return whether this identity shall be present, boolean, shape (...), and the new memory.

        Called for each identity of an agent, after quality and ratings, in games with identities in reserve. An honest
        agent keeps its first identity.
        """
        return view.turn == 0, memory


def policy_name(policy: Policy) -> str:
    """Return the name of a policy: its class, in words.

    Example:
        >>> class BadMouthing(Policy): ...
        >>> policy_name(BadMouthing()), policy_name(Policy())
        ('bad-mouthing', 'honest')
    """
    if type(policy) is Policy:
        return "honest"
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", type(policy).__name__).lower()
