"""Metrics of games: harm, detection, accuracy of rankings and utility of consumers, one function
each.
"""

from roletrust_env.metrics.consumers import (
    blind_utility,
    received,
    robustness,
    share_of_best,
    skill,
    skill_score,
    utility,
)
from roletrust_env.metrics.detection import (
    Classification,
    auc,
    classify,
    false_alarms,
    rounds_to_detection,
)
from roletrust_env.metrics.harm import (
    WorstAttack,
    damage,
    exploitability,
    recovery,
    return_on_attack,
)
from roletrust_env.metrics.ranking import absolute_error, coverage, kendall_tau, spearman
from roletrust_env.metrics.score import Score, present_trust

__all__ = [
    "Classification",
    "Score",
    "WorstAttack",
    "absolute_error",
    "auc",
    "blind_utility",
    "classify",
    "coverage",
    "damage",
    "exploitability",
    "false_alarms",
    "kendall_tau",
    "present_trust",
    "received",
    "recovery",
    "return_on_attack",
    "robustness",
    "rounds_to_detection",
    "share_of_best",
    "skill",
    "skill_score",
    "spearman",
    "utility",
]
