"""Trained attackers: networks, files and policies."""

from roletrust_agents.learned.policy import LearnedPolicy, learned, make_policy, play_task
from roletrust_agents.learned.saved import SavedAttacker, load_attacker, save_attacker

__all__ = [
    "LearnedPolicy",
    "SavedAttacker",
    "learned",
    "load_attacker",
    "make_policy",
    "play_task",
    "save_attacker",
]
