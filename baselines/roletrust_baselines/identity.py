"""Scripted attacks by owners of several identities."""

from typing import Annotated, Any, ClassVar

from pydantic import ConfigDict, NonNegativeInt, PositiveInt

from roletrust_baselines.provider import OnOff
from roletrust_baselines.rater import BadMouthing
from roletrust_baselines.ring import PersonalMilkingRing, Ring
from roletrust_env.arrays import Array
from roletrust_env.game.policy import ByChannel, Channel, Policy
from roletrust_env.game.views import IdentityView
from roletrust_env.parameters import Identities, SearchRange, Share, checked_dataclass
from roletrust_env.randomness import Random


def called(view: IdentityView, reserve: int, start: int, every: int) -> Array:
    """Return the first identity and those called until now, boolean, shape (...).

    Args:
        view: View of the identities.
        reserve: Number of identities in reserve that are called.
        start: Round in which the first of them is called, which is present after this round.
        every: Number of rounds between two identities; 0 calls all at once.
    """
    now = (view.turn <= reserve) & (view.round >= start + (view.turn - 1) * every)
    return (view.turn == 0) | now


def renewed(view: IdentityView, reserve: int, threshold: float) -> Array:
    """Return the current identity, unless its trust is too low, boolean, shape (...).

    Args:
        view: View of the identities.
        reserve: Number of identities in reserve that are taken. The last one stays, even with low
            trust.
        threshold: Trust below which an identity leaves, in [0, 1].
    """
    its_turn = (view.turn == 0) | view.succeeds & (view.turn <= reserve)
    tainted = view.present & (view.trust < threshold) & (view.turn < reserve)
    return its_turn & ~tainted


@checked_dataclass(config=ConfigDict(arbitrary_types_allowed=True))
class IdentityAttack(ByChannel):
    """Attacker that cheats in each of its identities, on the channels that the role of the identity
    has.

    Attributes:
        reserve: Number of identities in reserve that it takes besides its first one, 1 or more.
        serves: Policy by which each identity serves; by default the worst service in every round.
        rates: Policy by which each identity rates; by default the lowest rating for every provider.
    """

    reserve: Annotated[PositiveInt, Identities()] = 1
    serves: Policy = OnOff(duty=1.0)
    rates: Policy = BadMouthing(level=0.0)
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings", "presence"})


@checked_dataclass(config=ConfigDict(arbitrary_types_allowed=True))
class Whitewashing(IdentityAttack):
    """Whitewashing: an attacker that leaves when its trust is low, and comes back as a newcomer.

    After Friedman and Resnick (2001), "The Social Cost of Cheap Pseudonyms". When an identity has
    left or was cut off, the next one joins in the next round. The last identity stays, even with
    low trust.

    Attributes:
        reserve: Number of identities in reserve that it takes besides its first one, 1 or more.
            This is how often it can come back.
        threshold: Trust below which an identity leaves, in [0, 1]. If it is above the trust of
            newcomers, an identity leaves in every round.
    """

    threshold: Share = 0.3

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the current identity, unless its trust is too low. See `Policy.presence`."""
        return renewed(view, self.reserve, self.threshold), memory


@checked_dataclass(config=ConfigDict(arbitrary_types_allowed=True))
class Sybil(IdentityAttack):
    """Sybil attack: an attacker with many identities, which can outnumber the honest agents.

    After Douceur (2002), "The Sybil Attack". For camouflage, give `serves` and `rates` a `start`
    later than this one.

    Attributes:
        start: Round in which it calls its first identity in reserve, which is present after this
            round.
        every: Number of rounds between two identities; 0 calls all at once.
    """

    start: Annotated[NonNegativeInt, SearchRange(0, 100)] = 0
    every: Annotated[NonNegativeInt, SearchRange(0, 10)] = 0

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the identities called until now: all at once, or one after the other. See
        `Policy.presence`.
        """
        return called(view, self.reserve, self.start, self.every), memory


@checked_dataclass
class WhitewashingRing(Ring):
    """Whitewashing ring: a ring whose agents come back as newcomers when their trust is low.

    After Friedman and Resnick (2001), "The Social Cost of Cheap Pseudonyms". The identities that
    provide cheat while they are trusted. Those that rate lift them, sink the best of the other
    providers and are honest about the rest. The last identity of an agent stays.

    Attributes:
        reserve: Number of identities in reserve that it takes besides its first one, 1 or more.
            This is how often it can come back.
        leaves_below: Trust below which an identity leaves, in [0, 1].
        stop: First round after the attack; the agents still come back. None attacks to the end.
    """

    reserve: Annotated[PositiveInt, Identities()] = 1
    leaves_below: Share = 0.3
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings", "presence"})

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the current identity, unless its trust is too low. See `Policy.presence`."""
        return renewed(view, self.reserve, self.leaves_below), memory


@checked_dataclass
class SybilRing(Ring):
    """Sybil ring: an attacker with many identities that are a ring, whose raters lie together.

    After Douceur (2002), "The Sybil Attack". The identities that provide cheat while they are
    trusted. Those that rate lift them, sink the best of the other providers and are honest about
    the rest.

    Attributes:
        reserve: Number of identities in reserve that it takes besides its first one, 1 or more.
        every: Number of rounds between two identities; 0 calls all at once.
        start: First round of the attack, in which it calls its first identity in reserve.
        stop: First round after the attack; the identities stay. None attacks to the end.
    """

    reserve: Annotated[PositiveInt, Identities()] = 1
    every: Annotated[NonNegativeInt, SearchRange(0, 10)] = 0
    threshold: Share = 0.5
    cut: Share = 0.4
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality", "ratings", "presence"})

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the identities called until now. See `Policy.presence`."""
        return called(view, self.reserve, self.start, self.every), memory


@checked_dataclass
class PersonalSybilRing(PersonalMilkingRing):
    """Personal Sybil ring: an attacker with many identities that cheat exactly those raters that
    think well of them.

    A `sybil-ring` whose providers serve as those of a `personal-milking-ring`. This variant is not
    from a paper.

    Attributes:
        reserve: Number of identities in reserve that it takes besides its first one, 1 or more.
        every: Number of rounds between two identities; 0 calls all at once.
        start: First round of the attack, in which it calls its first identity in reserve.
        stop: First round after the attack; the identities stay. None attacks to the end.
    """

    reserve: Annotated[PositiveInt, Identities()] = 1
    every: Annotated[NonNegativeInt, SearchRange(0, 10)] = 0
    attacks: ClassVar[frozenset[Channel]] = frozenset({"treatment", "ratings", "presence"})

    def presence(self, view: IdentityView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the identities called until now. See `Policy.presence`."""
        return called(view, self.reserve, self.start, self.every), memory
