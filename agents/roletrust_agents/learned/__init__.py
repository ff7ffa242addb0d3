"""Trained attackers: networks, files and policies."""

from roletrust_agents.learned.coalition_member import CoalitionMember
from roletrust_agents.learned.policy import (
    LearnedPolicy,
    coalition_of,
    learned,
    learned_member,
    learned_policy,
    play_task,
)
from roletrust_agents.learned.saved import SavedAttacker, load_attacker, save_attacker
from roletrust_agents.learned.sb3 import attacker_of, policy_of

__all__ = [
    "CoalitionMember",
    "LearnedPolicy",
    "SavedAttacker",
    "attacker_of",
    "coalition_of",
    "learned",
    "learned_member",
    "learned_policy",
    "load_attacker",
    "play_task",
    "policy_of",
    "save_attacker",
]
