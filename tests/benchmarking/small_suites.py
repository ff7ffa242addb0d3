"""Suites that take a second or two."""

from typing import Any

from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import load_suite


def small(**changes: Any) -> Suite:
    """Return the suite of the project with few small worlds and two games in each."""
    suite = load_suite("standard")
    assert isinstance(suite, Suite)
    changed = {
        "max_cycles": {"low": 8, "high": 12},
        "agents": [
            {"role": "SR", "count": {"low": 6, "high": 8}, "noise": 0.1},
            {"role": "SP", "count": {"low": 6, "high": 8}, "ability": [0.0, 1.0]},
        ],
    }
    worlds = {
        **suite.worlds.model_dump(),
        "selection": 2,
        "measured": 3,
        "set": {**suite.worlds.set, **changed},
    }
    fields = {
        **suite.model_dump(),
        "name": "small",
        "worlds": worlds,
        "games": 2,
        "selection_games": 2,
        "models": ["mean", "block"],
        "own": ["block", "solo-threshold"],
        "attacks": ["bad-mouthing", "rank-lies", "on-off", "milking-ring", "sybil-ring:reserve=3"],
        "methods": ["scripts", "search"],
        "replayed": [],
        "search": {"candidates": 16, "games": 1},
    }
    if "models" in changes:
        fields["own"] = ["solo-threshold"]
    return Suite.model_validate({**fields, **changes})


def tiny(**changes: Any) -> Suite:
    """Return a suite of a few cells: honest play, and lies of raters."""
    settings = {"clean": {}, "raters": {"roles": ["SR"], "share": 0.3}}
    scripts = {"attacks": ["bad-mouthing", "random-rating"], "methods": ["scripts"]}
    return small(**{"name": "tiny", "settings": settings, **scripts, **changes})
