"""Shell completion of names of models, attacks, scenarios, suites, tasks and learners, which are looked up late."""

from collections.abc import Callable, Mapping
from importlib import import_module

import typer

Completer = Callable[..., list[tuple[str, str]]]


def _completer(items: Callable[[], Mapping[str, str]]) -> Completer:
    """Return a callback of typer that completes the keys of a mapping, with their values as descriptions."""

    def complete(incomplete: str) -> list[tuple[str, str]]:
        return [(name, about) for name, about in items().items() if name.startswith(incomplete)]

    return complete


def _described(module: str) -> Callable[[], Mapping[str, str]]:
    """Return a function that returns the names and the descriptions of the registry of a module."""
    return lambda: import_module(module).registry.describe()


def task_names() -> dict[str, str]:
    """Return the attack tasks by their short names, such as `RaterAttack`, with their ids."""
    from roletrust_env.envs.attack_env import TASKS

    return {task_id.removeprefix("RoleTrust/").removesuffix("-v0"): task_id for task_id in TASKS}


def seated_attacks(context: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """Complete `AGENT=NAME`: first the agents of the scenario, then the attacks."""
    agent, equals, name = incomplete.partition("=")
    if equals:
        return [(f"{agent}={attack}", about) for attack, about in named_attacks(name)]
    from roletrust_env.world.presets import make_scenario
    from roletrust_env.world.roster import Roster

    # An option without its value stops the parser before it reads the scenario, which is then among the arguments.
    scenario = next(iter(context.args), None) or context.params.get("scenario") or "paper-3x3"
    try:
        names = Roster.of(make_scenario(scenario)).owner_names
    except ValueError:
        return []
    return [(f"{one}=", "") for one in names if one.startswith(agent)]


def _suites() -> Mapping[str, str]:
    from roletrust_env.benchmarking.suite_files import suites

    return suites()


def _learners() -> Mapping[str, str]:
    from roletrust_env.benchmarking.learners.learner import registry, search_names

    return dict.fromkeys(search_names(), "") | registry.describe()


models = _completer(_described("roletrust_env.trust.model"))
named_attacks = _completer(_described("roletrust_env.game.policy"))
scenario_names = _completer(_described("roletrust_env.world.presets"))
tasks = _completer(task_names)
suites = _completer(_suites)
learners = _completer(_learners)
