"""What games come to in numbers: harm, detection, rank accuracy and what consumers get, each one function."""

from roletrust_env.metrics.consumers import blind_utility, robustness, utility
from roletrust_env.metrics.detection import Classified, auc, classified, false_alarms, rounds_to_detection
from roletrust_env.metrics.harm import Worst, damage, exploitability, recovery, return_on_attack
from roletrust_env.metrics.ranking import absolute_error, coverage, kendall_tau, spearman
from roletrust_env.metrics.score import Score, seen

__all__ = [
    "Classified",
    "Score",
    "Worst",
    "absolute_error",
    "auc",
    "blind_utility",
    "classified",
    "coverage",
    "damage",
    "exploitability",
    "false_alarms",
    "kendall_tau",
    "recovery",
    "return_on_attack",
    "robustness",
    "rounds_to_detection",
    "seen",
    "spearman",
    "utility",
]
