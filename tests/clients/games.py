"""Scenarios and tasks for the clients."""

from roletrust_env import make_scenario, scenarios
from roletrust_env.envs.attack_env import TASKS as _TASKS

TASKS = [f"roletrust_env:{task_id}" for task_id in _TASKS]
"""The attack tasks, by names that a process knows which has not imported them."""

TASK = TASKS[0]
"""One of them."""

OPEN = "open-system"
"""A scenario in which agents come and go."""


def closed() -> list[str]:
    """Return the scenarios for PettingZoo in which all agents are present from the first round to
    the last."""
    found = {name: make_scenario(name) for name in scenarios()}
    found = {name: it for name, it in found.items() if "sparse" not in it.tags}
    return [
        name
        for name, it in found.items()
        if it.admission is None and not any(group.open for group in it.agents)
    ]
