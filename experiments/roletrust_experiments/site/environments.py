"""The facts on the page of each environment: its docstring, its spaces and the calls that make it."""

import inspect
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import gymnasium

from roletrust_env.envs.attack_env import TASKS, AttackEnv
from roletrust_env.envs.parallel import RoleTrustParallelEnv, parallel_env

_GAME = "RoleTrust-v0"


class Described(NamedTuple):
    """Facts on the page of an environment.

    Attributes:
        about: Docstring in Markdown without its first line.
        summary: First line of the docstring.
        class_path: Import path of the class.
        facts: Code by its label, such as a space or the call that makes the environment.
    """

    about: str
    summary: str
    class_path: str
    facts: Mapping[str, str]


def described() -> dict[str, Described]:
    """Return the facts of every environment by its id."""
    game = parallel_env()
    spaces = {f"Action space of {agent}": repr(game.action_space(agent)) for agent in ("sp_0", "sr_0")}
    spaces |= {f"Observation space of {agent}": repr(game.observation_space(agent)) for agent in ("sp_0", "sr_0")}
    made = {
        "All at once": "roletrust_env.parallel_env()",
        "Agent by agent": "roletrust_env.env()",
        "By name": f'pettingzoo.make("parallel", "{_GAME}")',
    }
    return {_GAME: _described(RoleTrustParallelEnv, {**made, **spaces}), **{name: _task(name) for name in TASKS}}


def attack_tasks() -> Described:
    """Return the facts that all attack tasks have in common."""
    return _described(AttackEnv, {})


def _task(identity: str) -> Described:
    task = gymnasium.make(identity)
    facts = {
        "One game": f'gymnasium.make("{identity}")',
        "A batch": f'gymnasium.make_vec("{identity}", num_envs=1024)',
        "Action space": repr(task.action_space),
        "Observation space": repr(task.observation_space),
        "Rounds": str(task.spec.max_episode_steps if task.spec else None),
    }
    return _described(TASKS[identity], facts)


def _described(environment: type[Any], facts: Mapping[str, str]) -> Described:
    summary, _, about = (inspect.getdoc(environment) or "").partition("\n\n")
    path = f"{environment.__module__}.{environment.__qualname__}"
    return Described(_linked(about), summary, path, facts)


def _linked(text: str) -> str:
    """Return Markdown in which names of the library in backticks are links."""
    return re.sub(r"(?<!`)`(?=[\w.]*[A-Z._])([A-Za-z][\w.]*)`(?!`)", r"{py:obj}`\1`", text)
