"""Policies: how an agent plays, as functions of what it may see."""

import re
from typing import Any, ClassVar, Literal

from roletrust_env.arrays import Array
from roletrust_env.game.views import AgentView, IdentityView, ProviderView, RaterView
from roletrust_env.randomness import Random

Channel = Literal["quality", "treatment", "ratings", "silence", "presence"]
"""On what an agent decides; `"treatment"` is whom it serves how well, `"silence"` which ratings it does not send."""


class Policy:
    """How an agent plays. This one plays honestly; others override what they do differently.

    A policy is immutable. What it remembers from round to round is its memory, which its methods return anew. It sees
    one agent; every further axis of the view (agents that share the policy, then the batch) is carried along, so that
    one object plays in a PettingZoo loop, in one game and in a million.

    Attributes:
        attacks: the channels on which it does not play honestly, see `Channel`.
        reserve: identities in reserve that it takes; an agent must have as many.
    """

    attacks: ClassVar[frozenset[Channel]] = frozenset()
    reserve: int = 0

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Its memory before the first round, for agents and batch of this shape; None if it remembers nothing."""
        return None

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """The quality of its next service, shape (...), in [0, 1], and its new memory."""
        return 0 * view.trust + 1, memory

    def treats(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """The share of that quality that each rater gets, (S, ...), in [0, 1], or None for all alike; and its memory.

        Asked after `quality` in a `JointPolicy`; the faces of PettingZoo and a task's action have no such channel.
        """
        return None, memory

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Its ratings, shape (P, ...), in [0, 1], and its new memory. Ratings that nothing awaits are ignored."""
        return view.service, memory

    def withholds(self, view: RaterView, memory: Any, random: Random) -> tuple[Array | None, Any]:
        """Which of its ratings it does not send, boolean, (P, ...), or None for all being sent, and its new memory.

        Asked after `ratings` in a `JointPolicy`; the faces of PettingZoo and a task's action have no such channel.
        """
        return None, memory

    def both(self, view: AgentView, memory: Any, random: Random) -> tuple[Array, Array, Any]:
        """The quality and the ratings of an agent with both roles, and its new memory; by default role by role."""
        quality, memory = self.quality(view.provider, memory, random)
        ratings, memory = self.ratings(view.rater, memory, random)
        return quality, ratings, memory

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Whether it wants this identity to be there, boolean, (...), and its new memory.

        Asked of each identity of an agent, after quality and ratings, where anybody has a reserve; it counts for those
        that have one. An honest agent keeps to its first.
        """
        return view.turn == 0, memory


def policy_name(policy: Policy) -> str:
    """What to call a policy: its class, in words.

    Example:
        >>> class BadMouthing(Policy): ...
        >>> policy_name(BadMouthing()), policy_name(Policy())
        ('bad-mouthing', 'honest')
    """
    if type(policy) is Policy:
        return "honest"
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", type(policy).__name__).lower()
