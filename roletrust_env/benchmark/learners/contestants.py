"""Who takes part in the learners' benchmark, by name."""

from collections.abc import Callable
from typing import Any

from roletrust_env.benchmark.attackers import SEARCHING, searching
from roletrust_env.benchmark.learners.learner import Entered, registry
from roletrust_env.benchmark.learners.suite import FOOT, TOPS, LearnersSuite
from roletrust_env.errors import suggest
from roletrust_env.evaluation.search import HonestPlay, SearchMethod, search_methods
from roletrust_env.evaluation.specs import named_factory, parse_named


def named(suite: LearnersSuite) -> dict[str, Callable[..., Any]]:
    """What makes the learners of a suite that are no part of it, by what they are."""
    others = [name for name in suite.learners if name != FOOT and name not in (*TOPS, *SEARCHING)]
    return {f"learner {name}": named_factory(registry, name) for name in others}


def contestant(name: str, task_id: str) -> SearchMethod:
    """A contestant on a task.

    Args:
        name: `FOOT`, one of `TOPS` or of `SEARCHING`, or of a learner: of an installed package, or
            `package.module:Class`, each also with parameters, as `NAME:key=value,...`.
        task_id: one of `TASKS`.

    Raises:
        ValueError: nobody has the name, or the learner cannot be made.
    """
    if name == FOOT:
        return HonestPlay()
    if name in TOPS:
        return search_methods.make(name)
    if name in SEARCHING:
        return searching(name)
    if ":" not in name and name not in registry.names():
        known = suggest(name, [*SEARCHING, *registry.names()])
        raise ValueError(f"unknown learner {name!r}{known}, or your own package.module:Class")
    return Entered(parse_named(registry, name), name, task_id)
