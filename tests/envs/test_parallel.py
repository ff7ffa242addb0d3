"""The parallel face: what it refuses, and that refusing changes nothing; who takes part when."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import data_equivalence
from refusals import refuses

import roletrust_env
from roletrust_env import RoleTrustParallelEnv, Scenario, parallel_env

AGENTS = [
    {"role": "SR", "count": 2, "noise": 0.1},
    {"role": "SP", "count": 2},
    {"role": "SR+SP", "count": 2, "noise": 0.1},
]


def started(**changes: Any) -> RoleTrustParallelEnv:
    """An environment two rounds into an episode; one SR joins only at the end."""
    scenario = Scenario(agents=[*AGENTS, {"role": "SR", "joins": 40}], max_cycles=50)
    env = parallel_env(scenario, **changes)
    env.reset(seed=7)
    for _ in range(2):
        env.step(valid(env))
    return env


def valid(env: RoleTrustParallelEnv) -> dict[str, Any]:
    rng = np.random.default_rng(len(env.agents))
    return {
        agent: rng.random(env.action_space(agent).shape, dtype=np.float32) for agent in env.agents
    }


MASKED = np.ma.masked_array([0.5], [True])


def swap(agent: str, action: Any) -> Callable[[dict], Any]:
    return lambda actions: actions | {agent: action}


def without(agent: str) -> Callable[[dict], Any]:
    return lambda actions: {name: action for name, action in actions.items() if name != agent}


def vector(*entries: float) -> np.ndarray:
    return np.array(entries, dtype=np.float32)


@pytest.mark.parametrize(
    ("spoil", "named", "allowed"),
    [
        pytest.param(swap("sp_0", vector(np.nan)), ["sp_0", "nan"], "[0, 1]", id="NaN"),
        pytest.param(
            swap("srsp_1", vector(0, 0, 0, 0, np.nan)),
            ["srsp_1", "nan"],
            "[0, 1]",
            id="NaN among others",
        ),
        pytest.param(swap("sp_1", vector(np.inf)), ["sp_1", "inf"], "[0, 1]", id="inf"),
        pytest.param(swap("sp_1", vector(-np.inf)), ["sp_1", "-inf"], "[0, 1]", id="-inf"),
        pytest.param(
            swap("sr_0", vector(0, 1.25, 0, 0)), ["sr_0", "1.25"], "[0, 1]", id="too large"
        ),
        pytest.param(
            swap("sr_0", vector(0, -0.25, 0, 0)), ["sr_0", "-0.25"], "[0, 1]", id="too small"
        ),
        pytest.param(
            swap("sp_0", vector(1.0000001)),
            ["sp_0", "1.0000001192092896"],
            "[0, 1]",
            id="just too large",
        ),
        pytest.param(swap("sp_0", vector(0, 0)), ["sp_0", "(2,)"], "(1,)", id="too long"),
        pytest.param(swap("sr_1", vector(0)), ["sr_1", "(1,)"], "(4,)", id="too short"),
        pytest.param(swap("sr_1", np.zeros((2, 4))), ["sr_1", "(2, 4)"], "(4,)", id="two rows"),
        pytest.param(swap("sr_0", 0.5), ["sr_0", "()"], "(4,)", id="a number for many"),
        pytest.param(swap("sp_0", []), ["sp_0"], "(1,)", id="an empty list"),
        pytest.param(
            swap("sr_0", [0.5, [0.5]]),
            ["sr_0"],
            "(4,)",
            id="rows of many lengths",
        ),
        pytest.param(
            swap("sr_0", [0, 0, 0, 1.5]), ["sr_0", "1.5"], "[0, 1]", id="a list, too large"
        ),
        pytest.param(
            swap("sp_0", torch.tensor(torch.nan)), ["sp_0", "nan"], "[0, 1]", id="a tensor, NaN"
        ),
        pytest.param(
            swap("sp_0", torch.ones(1, requires_grad=True)),
            ["sp_0"],
            "(1,)",
            id="a gradient",
        ),
        pytest.param(
            swap("sp_0", None),
            ["sp_0"],
            "(1,)",
            id="None",
        ),
        pytest.param(swap("sp_0", "good"), ["sp_0", "good"], "(1,)", id="a string"),
        pytest.param(
            swap("sp_0", np.array(["good"])), ["sp_0", "good"], "(1,)", id="an array of strings"
        ),
        pytest.param(swap("sp_0", np.array(["0.5"])), ["sp_0"], "(1,)", id="an array of digits"),
        pytest.param(swap("sp_0", np.array([0.5j])), ["sp_0"], "(1,)", id="complex"),
        pytest.param(
            swap("sp_0", np.array([None])), ["sp_0", "None"], "(1,)", id="an array of None"
        ),
        pytest.param(swap("sp_0", MASKED), ["sp_0"], "(1,)", id="masked"),
        pytest.param(without("sr_1"), ["sr_1"], "sr_0", id="missing"),
        pytest.param(lambda _: {}, ["sr_0"], "srsp_1", id="none"),
        pytest.param(swap("sr_2", vector(0, 0, 0, 0)), ["sr_2"], "srsp_1", id="absent"),
        pytest.param(swap("robin", vector(0)), ["robin"], "srsp_1", id="unknown"),
        pytest.param(lambda a: list(a.values()), ["list"], "dict", id="list of actions"),
        pytest.param(lambda _: None, ["NoneType"], "dict", id="no actions"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_a_bad_action_is_refused_and_changes_nothing(
    spoil: Callable, named: list[str], allowed: str
) -> None:
    env, twin = started(), started()
    before = env.state()
    with refuses(ValueError, allowed, *named):
        env.step(spoil(valid(env)))
    assert np.array_equal(env.state(), before)
    for _ in range(3):
        assert data_equivalence(env.step(valid(env)), twin.step(valid(twin)))
        assert np.array_equal(env.state(), twin.state())


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_masked_entries_are_refused_where_all_agents_act(dtype: type) -> None:
    env, twin = parallel_env(), parallel_env()
    for one in (env, twin):
        one.reset(seed=0)
    whole = {
        agent: np.ma.masked_array(action.astype(dtype), False)
        for agent, action in valid(twin).items()
    }
    with refuses(ValueError, "sp_0"):
        env.step({**whole, "sp_0": MASKED.astype(dtype)})
    assert data_equivalence(
        env.step(whole), twin.step({agent: action.data for agent, action in whole.items()})
    )


@pytest.mark.parametrize("dtype", [np.float64, np.float16, np.int64, np.bool_])
def test_numbers_of_any_precision_are_taken(dtype: type) -> None:
    env, twin = started(), started()
    ones = {agent: np.ones(env.action_space(agent).shape, dtype) for agent in env.agents}
    assert data_equivalence(
        env.step(ones), twin.step({agent: a.astype(np.float32) for agent, a in ones.items()})
    )


@pytest.mark.parametrize(
    "shaped",
    [
        np.squeeze,
        lambda action: action[None],
        np.ndarray.tolist,
        torch.asarray,
        lambda action: torch.asarray(action)[None],
    ],
    ids=["squeezed", "with an axis more", "list", "tensor", "tensor with an axis more"],
)
def test_an_action_of_the_right_size_is_taken(shaped: Callable) -> None:
    """AgileRL squeezes (1,) to (); others hand over lists, or tensors as their networks make
    them."""
    env, twin = started(), started()
    actions = valid(env)
    assert data_equivalence(
        env.step({agent: shaped(a) for agent, a in actions.items()}), twin.step(actions)
    )


def test_the_spaces_are_dictionaries_too_and_the_luck_can_be_shared() -> None:
    env = started()
    assert env.action_spaces == {agent: env.action_space(agent) for agent in env.possible_agents}
    assert env.observation_spaces == {
        agent: env.observation_space(agent) for agent in env.possible_agents
    }
    assert isinstance(env.np_random, np.random.Generator)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            {"scenario": "paper3x3"},
            ["scenario", "paper3x3", "paper-3x3", "crowd-10x10"],
        ),
        ({"scenario": "zzz"}, ["zzz", "paper-3x3", "peers"]),
        ({"scenario": None}, ["scenario", "None"]),
        ({"scenario": 3}, ["scenario", "3"]),
        ({"scenario": "no-such-file.toml"}, ["no-such-file.toml"]),
        ({"trust_model": "role-turst"}, ["role-turst", "role-trust", "mean"]),
        ({"trust_model": 3}, ["trust", "3"]),
        ({"render_mode": "hologram"}, ["render_mode", "hologram", "human", "rgb_array", "ansi"]),
        ({"lam": 1.0}, ["lam", "1.0", "[0.5, 1)"]),
        ({"max_cycles": 0}, ["max_cycles", "0"]),
        ({"agents": ({"role": "SR"},)}, ["agents"]),
    ],
    ids=str,
)
@pytest.mark.parametrize("face", ["parallel_env", "env"])
def test_bad_arguments_are_refused(face: str, arguments: dict, words: list[str]) -> None:
    with refuses(ValueError, *words):
        getattr(roletrust_env, face)(**arguments)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"attackers": ["sr_9"]}, ("sr_9", "sr_0")),
        ({"attackers": [["sr_0"]]}, ("sr_0",)),
        ({"attackers": 5}, ("attackers", "5")),
        ("attackers", ("options", "attackers")),
    ],
)
def test_options_that_cannot_be_are_refused(options: Any, words: tuple[str, ...]) -> None:
    env, twin = started(), started()
    with refuses(ValueError, *words):
        env.reset(seed=1, options=options)
    assert data_equivalence(env.step(valid(env)), twin.step(valid(twin)))
    env.reset(options={"attackers": ["sr_1", "sp_0"], "whatever": 3})
    assert env.attackers == ("sr_1", "sp_0")
    env.reset(options={"attackers": None})
    assert env.attackers == ()


def test_a_bad_seed_changes_nothing() -> None:
    env, twin = started(), started()
    with refuses(Exception, "seed", "-1"):  # Gymnasium's own error
        env.reset(seed=-1)
    assert data_equivalence(env.step(valid(env)), twin.step(valid(twin)))


def test_order_is_enforced() -> None:
    env = parallel_env(max_cycles=1, render_mode="ansi")
    for early in (lambda: env.step({}), env.state, env.render):
        with refuses(RuntimeError, "reset()"):
            early()
    env.reset(seed=0)
    actions = valid(env)
    *_, truncations, _ = env.step(actions)
    assert all(truncations.values())
    with refuses(RuntimeError, "reset()"):
        env.step(actions)
    assert env.step({}) == ({}, {}, {}, {}, {})  # SuperSuit's black_death_v3 takes it
    assert env.state_space.contains(env.state())
    env.reset()
    env.step(actions)


def test_render_without_a_mode_says_so() -> None:
    env = started()
    with refuses(RuntimeError, "render_mode"):
        env.render()


def test_who_takes_part_when() -> None:
    """sr_1 joins in round 2; sp_1 leaves in round 3; sp_0 serves badly and is cut off."""
    scenario = Scenario(
        agents=[
            {"role": "SR"},
            {"role": "SR", "joins": 2},
            {"role": "SP"},
            {"role": "SP", "leaves": 3},
            {"role": "SP"},
        ],
        admission={"threshold": 0.2, "rounds": 2},
        max_cycles=6,
    )
    env = parallel_env(scenario)
    env.reset(seed=0)
    there, fates, flags = [env.agents], {}, {}
    while env.agents:
        actions = {
            agent: np.full(env.action_space(agent).shape, 0.0 if agent == "sp_0" else 1.0)
            for agent in env.agents
        }
        for agent in env.agents:
            if agent.startswith("sr"):
                actions[agent] = vector(0, 1, 1)
        observations, rewards, terminations, truncations, infos = env.step(actions)
        there.append(env.agents)
        if len(there) == 3:
            assert infos["sr_1"]["trust"] == 0.5
            assert rewards["sr_1"] == 0.0
            assert not terminations["sr_1"]
        fates |= {agent: info["fate"] for agent, info in infos.items() if "fate" in info}
        flags |= {a: (terminations[a], truncations[a]) for a in observations}
    assert there == [
        ["sr_0", "sp_0", "sp_1", "sp_2"],
        ["sr_0", "sp_0", "sp_1", "sp_2"],
        ["sr_0", "sr_1", "sp_0", "sp_1", "sp_2"],
        ["sr_0", "sr_1", "sp_0", "sp_2"],
        # ToP of sp_0: 0.5, 0.25, 0.125, 0.0625 after rounds 1, 2, 3, 4
        ["sr_0", "sr_1", "sp_2"],
        ["sr_0", "sr_1", "sp_2"],
        [],
    ]
    assert fates == {"sp_1": "left", "sp_0": "cut off"}
    gone, truncated = (True, False), (False, True)
    assert flags == {
        "sr_0": truncated,
        "sr_1": truncated,
        "sp_0": gone,
        "sp_1": gone,
        "sp_2": truncated,
    }


def test_who_would_come_when_it_is_over_does_not_come() -> None:
    env = parallel_env(
        agents=[{"role": "SR"}, {"role": "SP"}, {"role": "SR", "joins": 2}], max_cycles=2
    )
    env.reset(seed=0)
    env.step(valid(env))
    for part in env.step(valid(env)):
        assert set(part) == {"sr_0", "sp_0"}


def test_infos_hold_the_truth() -> None:
    env = started()
    actions = valid(env)
    observations, rewards, *_, infos = env.step(actions)
    assert infos["sp_1"]["trust"] == pytest.approx(
        float(env.layout.provider(observations["sp_1"]).trust)
    )
    assert infos["sp_1"]["quality"] == actions["sp_1"][0]
    quality = [float(actions[agent][0]) for agent in ("sp_0", "sp_1", "srsp_0", "srsp_1")]
    assert infos["sr_0"]["received"] == pytest.approx(quality)
    assert infos["srsp_0"]["received"] == pytest.approx([*quality[:2], 0, quality[3]])
    assert infos["srsp_1"]["quality"] == pytest.approx(quality[3])
    assert set(infos["srsp_1"]) == {"trust", "rater_trust", "provider_trust", "quality", "received"}
    assert rewards["sr_0"] == infos["sr_0"]["trust"]
    assert rewards["srsp_1"] == pytest.approx(infos["srsp_1"]["trust"] - 0.1 * quality[3])
    both = env.layout.both(observations["srsp_1"])
    assert both.trust == pytest.approx(infos["srsp_1"]["trust"])
    assert both.rater.trust == pytest.approx(infos["srsp_1"]["rater_trust"])
    assert both.provider.trust == pytest.approx(infos["srsp_1"]["provider_trust"])


def test_observations_hold_what_the_agent_would_see() -> None:
    env = started()
    actions = valid(env)
    before = env.layout.rater(env.step(actions)[0]["sr_0"])
    assert np.all(before.awaiting)
    actions = valid(env)
    observations, *_ = env.step(actions)
    rater, provider = (
        env.layout.rater(observations["sr_0"]),
        env.layout.provider(observations["sp_1"]),
    )
    assert rater.round == provider.round == 4
    assert np.array_equal(rater.ratings, actions["sr_0"])
    assert np.array_equal(rater.rated, before.awaiting)
    assert provider.ratings[0] == actions["sr_0"][1]
    assert provider.ratings[3] == actions["srsp_0"][2]  # quality first
    assert provider.rated.tolist() == [True, True, False, True, True]  # sr_2 has not joined
    assert rater.published[1] == provider.trust
    assert provider.value == 1
    both = env.layout.both(observations["srsp_0"])
    assert both.rater.awaiting.tolist() == [True, True, False, True]
    assert both.rater.service[2] == 0


@pytest.mark.parametrize(
    "duplicate",
    [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))],
    ids=["copy", "pickle"],
)
def test_a_copy_plays_on_alike_and_apart(duplicate: Callable) -> None:
    env, twin = started(), started()
    copied = duplicate(env)
    for _ in range(3):
        expected = twin.step(valid(twin))
        assert data_equivalence(copied.step(valid(copied)), expected)
    assert data_equivalence(env.step(valid(env)), started().step(valid(env)))


def test_everyone_absent_at_first_is_refused() -> None:
    """PettingZoo has no step in which nobody takes part, so such a game could not begin."""
    with refuses(ValueError, "joins", "0"):
        parallel_env(agents=[{"role": "SR", "joins": 3}, {"role": "SP", "joins": 2}])
