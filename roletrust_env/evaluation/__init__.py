"""Evaluation: how an attack is named, searched for and measured.

An attack is named by a spec (`specs`), played by an attacker (`attackers`), found by a search
method under a budget (`search`), and measured in held-out games (`measurement`, `evaluate`).
"""

from roletrust_env.evaluation.evaluate import Evaluation, evaluate
from roletrust_env.evaluation.search import (
    Budget,
    SearchMethod,
    SearchResult,
    find,
    register_search_method,
)

__all__ = [
    "Budget",
    "Evaluation",
    "SearchMethod",
    "SearchResult",
    "evaluate",
    "find",
    "register_search_method",
]
