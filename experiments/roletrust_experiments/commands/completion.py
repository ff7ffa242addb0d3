"""Shell completion of names: models, attacks, scenarios, suites, tasks and learners."""

from collections.abc import Callable, Mapping

import typer

from roletrust_env import make_scenario
from roletrust_env.benchmarking.learners.learner import registry as learner_registry
from roletrust_env.benchmarking.learners.learner import search_names
from roletrust_env.benchmarking.suite_files import suites as benchmark_suites
from roletrust_env.envs.attack_env import TASKS
from roletrust_env.evaluation.search import search_methods
from roletrust_env.game.policy import registry as attackers
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world.presets import registry as scenarios
from roletrust_env.world.roster import Roster

Completer = Callable[..., list[tuple[str, str]]]


def _completer(items: Callable[[], Mapping[str, str]]) -> Completer:
    """Return a callback of typer that completes the keys of a mapping, with their values as descriptions."""

    def complete(incomplete: str) -> list[tuple[str, str]]:
        return [(name, about) for name, about in items().items() if name.startswith(incomplete)]

    return complete


def task_names() -> dict[str, str]:
    """Return the attack tasks by their short names, such as `RaterAttack`, with their ids."""
    return {task_id.removeprefix("RoleTrust/").removesuffix("-v0"): task_id for task_id in TASKS}


def seated_attacks(context: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """Complete `AGENT=NAME`: first the agents of the scenario, then the attacks."""
    agent, equals, name = incomplete.partition("=")
    if equals:
        return [(f"{agent}={attack}", about) for attack, about in named_attacks(name)]
    # An option without its value stops the parser before it reads the scenario, which is then among the arguments.
    scenario = next(iter(context.args), None) or context.params.get("scenario") or "paper-3x3"
    try:
        names = Roster.of(make_scenario(scenario)).owner_names
    except ValueError:
        return []
    return [(f"{one}=", "") for one in names if one.startswith(agent)]


models = _completer(trust_models.describe)
named_attacks = _completer(attackers.describe)
scenario_names = _completer(scenarios.describe)
tasks = _completer(task_names)
suites = _completer(benchmark_suites)
ways = _completer(lambda: dict.fromkeys(("scripts", *search_methods.names()), ""))
learners = _completer(lambda: dict.fromkeys(search_names(), "") | learner_registry.describe())
