"""Policies: how an agent plays, as functions of what it may see; their registry, and bases of
attacks.
"""

import re
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import NonNegativeInt, PositiveInt, model_validator

from roletrust_env.arrays import Array, device_of, namespace
from roletrust_env.game.views import AgentView, IdentityView, ProviderView, RaterView
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random
from roletrust_env.registry import Registry
from roletrust_env.shapes import GameFlags, PerGame, PerProvider, PerRater, ProviderFlags, Shape

Channel = Literal["quality", "treatment", "ratings", "silence", "claims", "presence"]
"""Decision of an agent. `"treatment"` is the share of quality for each rater, `"silence"` the
ratings it withholds, `"claims"` the priority of ratings without a service."""


class Policy:
    """The behaviour of an agent. This class plays honestly; subclasses override what they do
    differently.

    A policy is immutable. Its memory from round to round is separate, and its methods return the
    new memory. A policy sees one agent. Further axes of the view (agents that share the policy,
    then the batch) are carried along, so that one object plays in a PettingZoo loop, in one game
    and in a million.

    Attributes:
        attacks: Channels on which the policy does not play honestly, see `Channel`.
        reserve: Number of identities in reserve that the policy needs.
    """

    attacks: ClassVar[frozenset[Channel]] = frozenset()
    reserve: int = 0

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return the memory before the first round, for agents and a batch of this shape; None
        without a memory.
        """
        return None

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[PerGame, Any]:
        """Return the quality of the next service, shape (...), in [0, 1], and the new memory."""
        return 0 * view.trust + 1, memory

    def treats(
        self, view: ProviderView, memory: Any, random: Random
    ) -> tuple[PerRater | None, Any]:
        """Return the share of that quality for each rater, shape (S, ...), in [0, 1], and the new
        memory.

        None serves all raters alike.

        Called after `quality` in a `JointPolicy`; the faces of PettingZoo and a task's action have
        no such channel.
        """
        return None, memory

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[PerProvider, Any]:
        """Return the ratings, shape (P, ...), in [0, 1], and the new memory.

        Ratings of services that the rater did not receive are ignored, unless it claims them.
        """
        return view.service, memory

    def withholds(
        self, view: RaterView, memory: Any, random: Random
    ) -> tuple[ProviderFlags | None, Any]:
        """Return which ratings are withheld, boolean, shape (P, ...), and the new memory; None
        sends all ratings.

        Called after `ratings` in a `JointPolicy`; the faces of PettingZoo and a task's action have
        no such channel.
        """
        return None, memory

    def claims(
        self, view: RaterView, memory: Any, random: Random
    ) -> tuple[PerProvider | None, Any]:
        """Return the priority of a rating without a service, shape (P, ...), in [0, 1], and the new
        memory.

        Its value is that of `ratings`. A priority of 0 sends no rating of this provider; None
        claims nothing.

        Called after `withholds` in a `JointPolicy`, if the scenario has open reports; the faces of
        PettingZoo and a task's action have no such channel.
        """
        return None, memory

    def both(
        self, view: AgentView, memory: Any, random: Random
    ) -> tuple[PerGame, PerProvider, Any]:
        """Return quality and ratings of an SR+SP agent, and the new memory. By default each role
        decides alone.
        """
        quality, memory = self.quality(view.provider, memory, random)
        ratings, memory = self.ratings(view.rater, memory, random)
        return quality, ratings, memory

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[GameFlags, Any]:
        """Return whether this identity shall be present, boolean, shape (...), and the new memory.

        Called for each identity of an agent, after quality and ratings, in games with identities in
        reserve. An honest agent keeps its first identity.
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


registry: Registry[Policy] = Registry("attacker", "roletrust_env.attackers", Policy)


register_attacker = registry.register
"""Register the class of an attacker under a name, see `Registry.register`."""


def make_attacker(name: str, **parameters: Any) -> Policy:
    """Make an attacker by name.

    Args:
        name: Registered name, or name of an entry point in the group `roletrust_env.attackers`.
        **parameters: Parameters of the attacker.

    Raises:
        ValueError: The name is unknown, the attacker has no such parameter, or a value is not
            allowed.

    Example:
        >>> make_attacker("on-off", period=4, start=10)
        OnOff(start=10, stop=None, period=4, duty=0.5, bad=0.0, good=1.0, switching='regular')
    """
    return registry.make(name, **parameters)


def attackers() -> dict[str, str]:
    """Return the known attackers: name and one line of description."""
    return registry.describe()


class ByChannel(Policy):
    """A policy that serves by one policy and rates by another.

    Attributes:
        serves: Policy for services.
        rates: Policy for ratings.
    """

    serves: Policy
    rates: Policy

    def begin(self, random: Random, shape: tuple[int, ...]) -> Any:
        """Return the memories of the two policies. See `Policy.begin`."""
        return self.serves.begin(random, shape), self.rates.begin(random, shape)

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[PerGame, Any]:
        """See `Policy.quality`."""
        quality, mine = self.serves.quality(view, memory[0], random)
        return quality, (mine, memory[1])

    def treats(
        self, view: ProviderView, memory: Any, random: Random
    ) -> tuple[PerRater | None, Any]:
        """See `Policy.treats`."""
        treatment, mine = self.serves.treats(view, memory[0], random)
        return treatment, (mine, memory[1])

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[PerProvider, Any]:
        """See `Policy.ratings`."""
        ratings, mine = self.rates.ratings(view, memory[1], random)
        return ratings, (memory[0], mine)

    def withholds(
        self, view: RaterView, memory: Any, random: Random
    ) -> tuple[ProviderFlags | None, Any]:
        """See `Policy.withholds`."""
        withheld, mine = self.rates.withholds(view, memory[1], random)
        return withheld, (memory[0], mine)

    def claims(
        self, view: RaterView, memory: Any, random: Random
    ) -> tuple[PerProvider | None, Any]:
        """See `Policy.claims`."""
        claims, mine = self.rates.claims(view, memory[1], random)
        return claims, (memory[0], mine)


@checked_dataclass
class WindowedAttack(Policy):
    """A scripted attack with a beginning and an end; before and after it the agent plays honestly.

    Attributes:
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    start: NonNegativeInt = 0
    stop: PositiveInt | None = None

    @model_validator(mode="after")
    def _check_window(self) -> Self:
        if self.stop is not None and self.stop <= self.start:
            raise ValueError(f"stop is {self.stop}; it must be later than start, {self.start}")
        return self

    def active(self, round: Annotated[Array, Shape("...", "number")]) -> GameFlags:
        """Return whether the attack is active in a round, boolean, shape (...)."""
        on = round >= self.start
        return on if self.stop is None else on & (round < self.stop)


def asleep(random: Random, shape: tuple[int, ...]) -> GameFlags:
    """Return the memory of sleepers before the first round, boolean, see `wake` and
    `Policy.begin`.
    """
    like = random.like
    return namespace(like).zeros(shape, dtype=like.dtype, device=device_of(like)) > 0


def wake(now: GameFlags, memory: GameFlags) -> tuple[GameFlags, GameFlags]:
    """Return whether a sleeper is awake, and its new memory. Once it has woken up, it stays awake.

    Args:
        now: Whether the sleeper wakes up in this round, boolean.
        memory: Whether it was awake before.
    """
    awake = now | memory
    return awake, awake
