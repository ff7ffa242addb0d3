"""Scripted attackers, by name."""

from typing import Any

from baselines.coalition.collusion import Collusion
from baselines.coalition.orchestrated import Orchestrated
from baselines.coalition.self_promotion import SelfPromotion
from baselines.identity.sybil import Sybil
from baselines.identity.whitewashing import Whitewashing
from baselines.provider.camouflage import Camouflage
from baselines.provider.conflicting import Conflicting
from baselines.provider.exit import Exit
from baselines.provider.on_off import OnOff
from baselines.provider.opportunistic import Opportunistic
from baselines.provider.reputation_lag import ReputationLag
from baselines.provider.threshold_surfing import ThresholdSurfing
from baselines.provider.value_imbalance import ValueImbalance
from baselines.rater.bad_mouthing import BadMouthing
from baselines.rater.ballot_stuffing import BallotStuffing
from baselines.rater.camouflage_rating import CamouflageRating
from baselines.rater.complementary import Complementary
from baselines.rater.flip_flop import FlipFlop
from baselines.rater.optimistic import Optimistic
from baselines.rater.pessimistic import Pessimistic
from baselines.rater.random_rating import RandomRating
from baselines.rater.rep_trap import RepTrap
from baselines.rater.silent import Silent
from baselines.rater.transitive_lying import TransitiveLying
from roletrust_env.game.policy import Policy
from roletrust_env.registry import Registry

registry: Registry[Policy] = Registry("attacker", "roletrust_env.attackers", Policy)
registry.register("on-off", OnOff)
registry.register("camouflage", Camouflage)
registry.register("conflicting", Conflicting)
registry.register("exit", Exit)
registry.register("opportunistic", Opportunistic)
registry.register("reputation-lag", ReputationLag)
registry.register("threshold-surfing", ThresholdSurfing)
registry.register("value-imbalance", ValueImbalance)
registry.register("bad-mouthing", BadMouthing)
registry.register("ballot-stuffing", BallotStuffing)
registry.register("camouflage-rating", CamouflageRating)
registry.register("complementary", Complementary)
registry.register("flip-flop", FlipFlop)
registry.register("optimistic", Optimistic)
registry.register("pessimistic", Pessimistic)
registry.register("random-rating", RandomRating)
registry.register("rep-trap", RepTrap)
registry.register("silent", Silent)
registry.register("transitive-lying", TransitiveLying)
registry.register("collusion", Collusion)
registry.register("orchestrated", Orchestrated)
registry.register("self-promotion", SelfPromotion)
registry.register("whitewashing", Whitewashing)
registry.register("sybil", Sybil)


def register_attacker(name: str, factory: Any) -> None:
    """Make an attacker known by name.

    Args:
        name: the new name.
        factory: a callable `(**parameters) -> Policy`, usually the attacker's class.

    Raises:
        ValueError: the name is taken or is not a word.
    """
    registry.register(name, factory)


def make_attacker(name: str, **parameters: Any) -> Policy:
    """Make an attacker by name.

    Args:
        name: a registered name or that of an entry point in the group `roletrust_env.attackers`.
        **parameters: the attacker's own.

    Raises:
        ValueError: the name is unknown, the parameters are not the attacker's, or a value is not allowed.

    Example:
        >>> make_attacker("on-off", period=4, start=10)
        OnOff(start=10, stop=None, period=4, duty=0.5, bad=0.0, good=1.0, switching='regular')
    """
    return registry.make(name, **parameters)


def attackers() -> dict[str, str]:
    """The known attackers: name and one line of description."""
    return registry.describe()


__all__ = [
    "BadMouthing",
    "BallotStuffing",
    "Camouflage",
    "CamouflageRating",
    "Collusion",
    "Complementary",
    "Conflicting",
    "Exit",
    "FlipFlop",
    "OnOff",
    "Opportunistic",
    "Optimistic",
    "Orchestrated",
    "Pessimistic",
    "RandomRating",
    "RepTrap",
    "ReputationLag",
    "SelfPromotion",
    "Silent",
    "Sybil",
    "ThresholdSurfing",
    "TransitiveLying",
    "ValueImbalance",
    "Whitewashing",
    "attackers",
    "make_attacker",
    "register_attacker",
]
