"""Environments say what they are in one line, show themselves in a notebook, and refuse wrong names
in one line."""

import copy
import sys
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from pettingzoo.utils.wrappers import CaptureStdoutWrapper
from refusals import refuses

import roletrust_env
from roletrust_env.envs.attack_env import TASKS

FACTS = "'paper-3x3', RoleTrust(lam=0.5, initial=0.5), agents: 3 SR + 3 SP, rounds: 240"


def task_env(**arguments: Any) -> Any:
    return gymnasium.make("RoleTrust/RaterAttack-v0", **arguments).unwrapped


def test_reprs() -> None:
    aim = "compromised: sr_2, objective: damage, knowledge: black_box"
    task = f"{FACTS}; {aim}"
    assert repr(roletrust_env.parallel_env()) == f"RoleTrustParallelEnv({FACTS})"
    assert repr(roletrust_env.env()) == f"RoleTrustAECEnv({FACTS})"
    assert repr(task_env()) == f"RaterAttackEnv({FACTS}; {aim})"
    batch = gymnasium.make_vec("RoleTrust/RaterAttack-v0", num_envs=3)
    assert repr(batch) == f"AttackVectorEnv(AttackTask({task}), num_envs: 3)"


def begun(env: Any) -> Any:
    env.reset(seed=0)
    return env


@pytest.mark.parametrize(
    "make",
    [
        roletrust_env.parallel_env,
        roletrust_env.env,
        task_env,
        lambda render_mode: gymnasium.make_vec(
            "RoleTrust/RaterAttack-v0", num_envs=3, render_mode=render_mode
        ),
    ],
    ids=["parallel", "aec", "task", "batch"],
)
def test_an_environment_shows_a_picture_in_a_notebook(make: Any) -> None:
    env = make(render_mode="ansi")
    assert "<img" not in env._repr_html_()  # no game has begun
    shown = begun(env)._repr_html_()
    assert 'src="data:image/png;base64,' in shown
    assert shown.startswith("<code>")


def test_the_picture_is_of_the_state() -> None:
    env = begun(roletrust_env.parallel_env(noise=0.1))
    first = env._repr_html_()
    assert first == env._repr_html_()
    env.step({agent: env.action_space(agent).low for agent in env.agents})
    assert env._repr_html_() != first


def test_without_matplotlib_it_is_the_text(monkeypatch: pytest.MonkeyPatch) -> None:
    env = begun(roletrust_env.parallel_env())
    monkeypatch.delitem(sys.modules, "roletrust_env.rendering.drawing", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    shown = env._repr_html_()
    assert "<pre>" in shown
    assert "ToR" in shown


NAMES = "sr_0, sr_1, sr_2, sp_0, sp_1, sp_2"


@pytest.mark.parametrize("name", ["sr_9", 3, ["sr_0"]], ids=str)
@pytest.mark.parametrize(
    "ask",
    [
        lambda name: roletrust_env.parallel_env().action_space(name),
        lambda name: roletrust_env.parallel_env().observation_space(name),
        lambda name: roletrust_env.env().action_space(name),
        lambda name: roletrust_env.env().observation_space(name),
        lambda name: begun(roletrust_env.env()).observe(name),
        lambda name: roletrust_env.ParallelTransformAction(
            roletrust_env.parallel_env(), roletrust_env.RescaleClipAction
        ).action_space(name),
    ],
)
def test_an_unknown_agent_is_refused_with_the_names_of_the_known(ask: Any, name: Any) -> None:
    with refuses(ValueError, repr(name), NAMES):
        ask(name)


@pytest.mark.parametrize(
    "wrap",
    [
        lambda env: env,
        lambda env: roletrust_env.ParallelTransformAction(env, roletrust_env.RescaleClipAction),
        roletrust_env.FixedAgents,
    ],
)
@pytest.mark.parametrize("actions", [3, [0.5], None, np.zeros(3)], ids=str)
def test_actions_that_are_no_dictionary_are_refused(wrap: Any, actions: Any) -> None:
    env = begun(wrap(roletrust_env.parallel_env()))
    with refuses(ValueError, "actions", "dict"):
        env.step(actions)


def test_what_a_wrapper_adds_stays_with_its_environment() -> None:
    task = roletrust_env.make_task("paper-3x3", ("sp_2",))
    makers: list[Callable[[], Any]] = [
        lambda: roletrust_env.parallel_env(render_mode="ansi"),
        lambda: roletrust_env.env(render_mode="human"),
        lambda: roletrust_env.FixedAgents(roletrust_env.parallel_env()),
        *(lambda one=one: gymnasium.make(one, render_mode="ansi").unwrapped for one in TASKS),
        lambda: gymnasium.make_vec("RoleTrust/RaterAttack-v0", num_envs=1),
        lambda: roletrust_env.AttackVecEnv(task, 1),
    ]
    before = [copy.deepcopy(make().metadata) for make in makers]
    CaptureStdoutWrapper(makers[1]())
    for make in makers:
        env = make()
        env.metadata["render_modes"].append("hologram")
        env.metadata["render_fps"] = 1000
        if hasattr(env, "defaults"):
            with pytest.raises(TypeError):
                env.defaults["objective"] = "none"
    assert [make().metadata for make in makers] == before
