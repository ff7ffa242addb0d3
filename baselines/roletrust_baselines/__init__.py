"""Scripted attackers. Importing this package registers them."""

from roletrust_baselines.coalition import (
    Collusion,
    Orchestrated,
    Promotion,
    RankLies,
    ReviewBurst,
    SelfPromotion,
    ShiftedLies,
    SlanderUnmet,
    Sleeper,
    SwapEnds,
)
from roletrust_baselines.identity import (
    PersonalSybilRing,
    Sybil,
    SybilRing,
    Whitewashing,
    WhitewashingRing,
)
from roletrust_baselines.provider import (
    Camouflage,
    Exit,
    OnOff,
    Opportunistic,
    ReputationLag,
    ThresholdSurfing,
    ValueImbalance,
)
from roletrust_baselines.rater import (
    BadMouthing,
    BallotStuffing,
    CamouflageRating,
    Complementary,
    FlipFlop,
    Optimistic,
    Pessimistic,
    RandomRating,
    RepTrap,
    Silent,
    TransitiveLying,
)
from roletrust_baselines.ring import CheatingRing, DividedRing, MilkingRing, PersonalMilkingRing
from roletrust_baselines.treatment import (
    Conflicting,
    Discrimination,
    PersonalMilking,
    QuietDiscrimination,
    Rotation,
)
from roletrust_env.game.policy import registry

registry.register("on-off", OnOff)
registry.register("camouflage", Camouflage)
registry.register("conflicting", Conflicting)
registry.register("discrimination", Discrimination)
registry.register("exit", Exit)
registry.register("opportunistic", Opportunistic)
registry.register("reputation-lag", ReputationLag)
registry.register("threshold-surfing", ThresholdSurfing)
registry.register("value-imbalance", ValueImbalance)
registry.register("personal-milking", PersonalMilking)
registry.register("quiet-discrimination", QuietDiscrimination)
registry.register("rotation", Rotation)
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
registry.register("rank-lies", RankLies)
registry.register("promotion", Promotion)
registry.register("shifted-lies", ShiftedLies)
registry.register("slander-unmet", SlanderUnmet)
registry.register("swap-ends", SwapEnds)
registry.register("sleeper", Sleeper)
registry.register("review-burst", ReviewBurst)
registry.register("cheating-ring", CheatingRing)
registry.register("divided-ring", DividedRing)
registry.register("milking-ring", MilkingRing)
registry.register("personal-milking-ring", PersonalMilkingRing)
registry.register("whitewashing", Whitewashing)
registry.register("sybil", Sybil)
registry.register("whitewashing-ring", WhitewashingRing)
registry.register("sybil-ring", SybilRing)
registry.register("personal-sybil-ring", PersonalSybilRing)

__all__ = [
    "BadMouthing",
    "BallotStuffing",
    "Camouflage",
    "CamouflageRating",
    "CheatingRing",
    "Collusion",
    "Complementary",
    "Conflicting",
    "Discrimination",
    "DividedRing",
    "Exit",
    "FlipFlop",
    "MilkingRing",
    "OnOff",
    "Opportunistic",
    "Optimistic",
    "Orchestrated",
    "PersonalMilking",
    "PersonalMilkingRing",
    "PersonalSybilRing",
    "Pessimistic",
    "Promotion",
    "QuietDiscrimination",
    "RandomRating",
    "RankLies",
    "RepTrap",
    "ReputationLag",
    "ReviewBurst",
    "Rotation",
    "SelfPromotion",
    "ShiftedLies",
    "Silent",
    "SlanderUnmet",
    "Sleeper",
    "SwapEnds",
    "Sybil",
    "SybilRing",
    "ThresholdSurfing",
    "TransitiveLying",
    "ValueImbalance",
    "Whitewashing",
    "WhitewashingRing",
]
