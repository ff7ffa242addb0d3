"""Scripted attackers. Importing this package registers them."""

from roletrust_baselines.coalition.cheating_ring import CheatingRing
from roletrust_baselines.coalition.collusion import Collusion
from roletrust_baselines.coalition.milking_ring import MilkingRing
from roletrust_baselines.coalition.orchestrated import Orchestrated
from roletrust_baselines.coalition.promotion import Promotion
from roletrust_baselines.coalition.rank_lies import RankLies
from roletrust_baselines.coalition.review_burst import ReviewBurst
from roletrust_baselines.coalition.self_promotion import SelfPromotion
from roletrust_baselines.coalition.sleeper import Sleeper
from roletrust_baselines.coalition.swap_ends import SwapEnds
from roletrust_baselines.identity.sybil import Sybil
from roletrust_baselines.identity.sybil_ring import SybilRing
from roletrust_baselines.identity.whitewashing import Whitewashing
from roletrust_baselines.identity.whitewashing_ring import WhitewashingRing
from roletrust_baselines.provider.camouflage import Camouflage
from roletrust_baselines.provider.conflicting import Conflicting
from roletrust_baselines.provider.discrimination import Discrimination
from roletrust_baselines.provider.exit import Exit
from roletrust_baselines.provider.on_off import OnOff
from roletrust_baselines.provider.opportunistic import Opportunistic
from roletrust_baselines.provider.reputation_lag import ReputationLag
from roletrust_baselines.provider.threshold_surfing import ThresholdSurfing
from roletrust_baselines.provider.value_imbalance import ValueImbalance
from roletrust_baselines.rater.bad_mouthing import BadMouthing
from roletrust_baselines.rater.ballot_stuffing import BallotStuffing
from roletrust_baselines.rater.camouflage_rating import CamouflageRating
from roletrust_baselines.rater.complementary import Complementary
from roletrust_baselines.rater.flip_flop import FlipFlop
from roletrust_baselines.rater.optimistic import Optimistic
from roletrust_baselines.rater.pessimistic import Pessimistic
from roletrust_baselines.rater.random_rating import RandomRating
from roletrust_baselines.rater.rep_trap import RepTrap
from roletrust_baselines.rater.silent import Silent
from roletrust_baselines.rater.transitive_lying import TransitiveLying
from roletrust_env.game.policy_registry import registry

registry.register("on-off", OnOff)
registry.register("camouflage", Camouflage)
registry.register("conflicting", Conflicting)
registry.register("discrimination", Discrimination)
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
registry.register("rank-lies", RankLies)
registry.register("promotion", Promotion)
registry.register("swap-ends", SwapEnds)
registry.register("sleeper", Sleeper)
registry.register("review-burst", ReviewBurst)
registry.register("cheating-ring", CheatingRing)
registry.register("milking-ring", MilkingRing)
registry.register("whitewashing", Whitewashing)
registry.register("sybil", Sybil)
registry.register("whitewashing-ring", WhitewashingRing)
registry.register("sybil-ring", SybilRing)

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
    "Exit",
    "FlipFlop",
    "MilkingRing",
    "OnOff",
    "Opportunistic",
    "Optimistic",
    "Orchestrated",
    "Pessimistic",
    "Promotion",
    "RandomRating",
    "RankLies",
    "RepTrap",
    "ReputationLag",
    "ReviewBurst",
    "SelfPromotion",
    "Silent",
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
