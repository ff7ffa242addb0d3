"""Trained attackers: their networks, their files, and how they play."""

from roletrust_agents.learned.policy import LearnedPolicy, learned, learned_policy, play_task
from roletrust_agents.learned.saved import SavedAttacker, load_attacker, save_attacker

__all__ = [
    "LearnedPolicy",
    "SavedAttacker",
    "learned",
    "learned_policy",
    "load_attacker",
    "play_task",
    "save_attacker",
]
