"""Search methods of the learners' benchmark by name."""

from collections.abc import Callable
from typing import Any

from roletrust_env.benchmarking.learners.learner import LearnerSearch, registry
from roletrust_env.benchmarking.learners.suite import BOUNDS, HONEST_PLAY, LearnersSuite
from roletrust_env.errors import suggest
from roletrust_env.evaluation.search import HonestPlay, SearchMethod, search_methods
from roletrust_env.evaluation.specs import named_factory, parse_named


def search_names() -> list[str]:
    """Return the names of the search methods that learners are compared with: all registered ones but `BOUNDS`."""
    return [name for name in search_methods.names() if name not in BOUNDS]


def is_search(name: str) -> bool:
    """Return whether the name of a learner is one of `search_names()`, with parameters or without."""
    return name.partition(":")[0] in search_names()


def factories(suite: LearnersSuite) -> dict[str, Callable[..., Any]]:
    """Return the factories of the plug-in learners of a suite, by type and name.

    Args:
        suite: Suite with the learners.
    """
    others = [name for name in suite.learners if not is_search(name)]
    return {f"learner {name}": named_factory(registry, name) for name in others}


def make_search_method(name: str, task_id: str) -> SearchMethod:
    """Return a search method for a task.

    Args:
        name: `HONEST_PLAY`, one of `BOUNDS`, that of a search method, or the name of a learner: an installed one, or
            `package.module:Class`. Search methods and learners may have parameters, as in `NAME:key=value,...`.
        task_id: Gymnasium id of the task, one of `TASKS`.

    Raises:
        ValueError: The name is unknown, or the learner cannot be created.
    """
    if name == HONEST_PLAY:
        return HonestPlay()
    if name in BOUNDS:
        return search_methods.make(name)
    if is_search(name):
        return parse_named(search_methods, name)
    if ":" not in name and name not in registry.names():
        known = suggest(name, [*search_names(), *registry.names()])
        raise ValueError(f"unknown learner {name!r}{known}, or your own package.module:Class")
    return LearnerSearch(parse_named(registry, name), name, task_id)
