"""What an attacker may see, at each level of knowledge."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from attack_cases import LEVELS, busy, each, make, play

from roletrust_env import Game
from roletrust_env.game.attack_task import AttackTask, TaskState


def entries(tree: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every number of a state: its name, such as `trust.last[0,2]`, and a function that makes a
    state with another."""
    for field in tree._fields:
        value, name = getattr(tree, field), f"{path}{field}"
        if value is None:
            continue
        if hasattr(value, "_fields"):
            for inner, change in entries(value, f"{name}."):
                yield inner, lambda f=field, c=change: tree._replace(**{f: c()})
            continue
        for index in np.ndindex(np.shape(value)):

            def change(f: str = field, v: Any = value, i: tuple = index) -> Any:
                v = np.array(v)
                v[i] = not v[i] if v.dtype == bool else v[i] + (1 if v.dtype.kind == "i" else 0.01)
                return tree._replace(**{f: v[()]})

            yield f"{name}[{','.join(map(str, index))}]" if index else name, change


def visible(task: AttackTask, state: TaskState) -> set[str]:
    """The numbers of the state that the observation depends on."""
    before = task.observe(state)
    return {
        name
        for name, change in entries(state.game)
        if not np.array_equal(task.observe(TaskState(change(), state.memories)), before)
    }


def in_life(task: AttackTask) -> set[str]:
    """What the compromised agents see in life, of role-trust."""
    roster = task.game.roster
    seen = {"round"}
    for name in task.compromised:
        if name in roster.rater_names:
            i = roster.rater_names.index(name)
            seen.add(f"trust.tor[{i}]")
            for j in range(roster.n_providers):
                seen |= {
                    f"{field}[{i},{j}]" for field in ("service", "awaiting", "ratings", "rated")
                }
                seen.add(f"trust.top[{j}]")
        if name in roster.provider_names:
            j = roster.provider_names.index(name)
            seen |= {f"{field}[{j}]" for field in ("trust.top", "value", "quality")}
            seen |= {
                f"{field}[{i},{j}]"
                for field in ("ratings", "rated")
                for i in range(roster.n_raters)
            }
        if name.startswith("srsp"):
            k = int(name.split("_")[1])
            seen |= {f"counts.rated[{k}]", f"counts.provided[{k}]"}
    return seen


def midway(task: AttackTask, rounds: int = 7) -> TaskState:
    return list(play(task, 2))[rounds][1]


WATCHERS = [("sr_1",), ("sp_1",), ("srsp_1",), ("sr_0", "sp_2", "srsp_0")]


@pytest.mark.parametrize("names", WATCHERS, ids=str)
@pytest.mark.parametrize("access", ["everyone", "in-range"])
def test_each_level_of_knowledge_shows_exactly_its_own(names: tuple, access: str) -> None:
    """Perturb the state number by number: the trust of others, their memory, late ratings, who is
    in danger, ..."""
    task = make(busy(access), {"compromised": names})
    state, roster = midway(task), task.game.roster
    assert visible(task, state) == in_life(task)
    published = {f"trust.tor[{i}]" for i in range(roster.n_raters)} | {
        f"trust.top[{j}]" for j in range(roster.n_providers)
    }
    assert (
        visible(make(busy(access), {"compromised": names}, knowledge="grey_box"), state)
        == in_life(task) | published
    )
    everything = {name for name, _ in entries(state.game)}
    assert (
        visible(make(busy(access), {"compromised": names}, knowledge="white_box"), state)
        == everything
    )
    assert {
        "trust.last[3,0]",
        "transit.ratings[0,2,1]",
        "population.low[0]",
    } < everything - in_life(task) - published


@pytest.mark.parametrize("names", WATCHERS, ids=str)
def test_levels_of_knowledge_build_on_each_other(names: tuple) -> None:
    black, grey, white = (
        make(busy("in-range"), {"compromised": names}, knowledge=level) for level in LEVELS
    )
    state = midway(black)
    life, roster = [], black.game.roster
    of_sr, of_sp, of_both = black.game.observations(state.game)
    for name in names:
        role, index = name.split("_")
        life += {"sr": of_sr, "sp": of_sp, "srsp": of_both}[role][:, int(index)].tolist()
    assert black.observe(state).tolist() == life
    published = np.concatenate(black.game.published(state.game)).tolist()
    assert len(published) == roster.n_raters + roster.n_providers
    assert grey.observe(state).tolist() == life + published
    leaves: list[float] = []
    each(lambda array: leaves.extend(np.ravel(array).tolist()), state.game)
    assert white.observe(state).tolist() == life + published + leaves


def test_the_trust_models_memory_is_known_to_the_white_box_only() -> None:
    """With the mean, too, whose memory is another."""
    for level, knows in zip(LEVELS, (False, False, True), strict=True):
        task = AttackTask(Game(busy(), "mean"), ("sr_1",), knowledge=level)
        state = midway(task)
        hidden = {name for name, _ in entries(state.game) if name.startswith("trust.")}
        assert hidden
        everything = visible(task, state) >= {name for name, _ in entries(state.game)}
        assert everything == knows
