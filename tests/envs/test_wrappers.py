"""The wrappers: other actions, and everybody in every dictionary."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Box, Discrete, MultiDiscrete
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.wrappers import ClipAction
from gymnasium.wrappers.vector import VectorizeTransformAction
from pettingzoo.test import parallel_api_test, parallel_seed_test
from refusals import refuses
from task_cases import COLLUSION, PROVIDER, RATER, same

from roletrust_env import (
    DiscretizeLevels,
    FixedAgents,
    ParallelTransformAction,
    RescaleClipAction,
    parallel_env,
)

COME_AND_GO = {
    "agents": [
        {"role": "SR", "count": 2},
        {"role": "SP"},
        {"role": "SP", "joins": 2},
        {"role": "SR+SP", "leaves": 3},
    ],
    "max_cycles": 5,
}
WRAPPED = [
    pytest.param(RescaleClipAction, id="RescaleClipAction"),
    pytest.param(lambda env: DiscretizeLevels(env, 3), id="DiscretizeLevels"),
    pytest.param(
        lambda env: DiscretizeLevels(env, 3, multidiscrete=True),
        id="DiscretizeLevels, multidiscrete",
    ),
]


# --- actions of one learner
# -------------------------------------------------------------------------


@pytest.mark.parametrize("wrap", WRAPPED)
@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
def test_gymnasium_finds_nothing_wrong(wrap: Callable) -> None:
    check_env(wrap(gymnasium.make(RATER).unwrapped), skip_render_check=True)


@pytest.mark.parametrize("wrap", WRAPPED)
def test_a_spec_as_json_wraps_alike(wrap: Callable) -> None:
    env = wrap(gymnasium.make(RATER, noise=0.1))
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.action_space == env.action_space
    env.action_space.seed(0)
    assert same(again.reset(seed=1), env.reset(seed=1))
    for _ in range(3):
        action = env.action_space.sample()
        assert same(again.step(action), env.step(action))


def deed(env: gymnasium.Env, action: Any) -> list[float]:
    """What the provider has done, as its observation shows it."""
    env.reset(seed=0)
    return env.step(action)[0][3].tolist()


def test_scaled_actions_are_clipped() -> None:
    env = RescaleClipAction(gymnasium.make(PROVIDER, noise=0.0))
    assert env.action_space == Box(-1, 1, (1,), np.float32)
    for number, quality in ((-1, 0), (0, 0.5), (0.5, 0.75), (1, 1), (-7.5, 0), (3, 1), (np.inf, 1)):
        assert deed(env, np.array([number], np.float32)) == quality
    with refuses(ValueError, "action", "nan"):
        env.step(np.array([np.nan]))
    with refuses(ValueError, "action"):
        env.step(["good"])


@pytest.mark.parametrize(
    "action",
    [torch.zeros(3, requires_grad=True), [[0], [0, 1]], ["a", "b", "c"], None],
    ids=lambda a: type(a).__name__,
)
def test_what_no_action_can_be_made_of_is_refused_by_name(action: Any) -> None:
    one, each = (
        RescaleClipAction(gymnasium.make(RATER)),
        ParallelTransformAction(parallel_env(), RescaleClipAction),
    )
    one.reset(seed=0)
    with refuses(ValueError, "action"):
        one.step(action)
    each.reset(seed=0)
    with refuses(ValueError, "action", "sr_1"):
        each.step(
            {agent: each.action_space(agent).sample() for agent in each.agents} | {"sr_1": action}
        )


def test_truth_values_are_scaled_like_the_numbers_that_they_are() -> None:
    both = [ParallelTransformAction(parallel_env(noise=0.0), RescaleClipAction) for _ in range(2)]
    for env, kind in zip(both, (bool, float), strict=True):
        env.reset(seed=0)
        for _ in range(2):
            answers = env.step(
                {agent: np.zeros(env.action_space(agent).shape, kind) for agent in env.agents}
            )
        assert answers[4]["sp_0"]["quality"] == 0.5


def test_nothing_within_its_range_is_refused_for_rounding() -> None:
    env = RescaleClipAction(gymnasium.make(PROVIDER))
    near = np.nextafter(np.float32([-1, -1, 0, 1, 1]), np.float32([-2, 2, 1, -2, 2]))
    for dtype in (np.float16, np.float32, np.float64):
        for number in (*near, np.float32(0.1)):
            deed(env, np.array([number], dtype))


def test_levels_include_both_ends() -> None:
    env = DiscretizeLevels(gymnasium.make(PROVIDER, noise=0.0), 5)
    assert env.action_space == Discrete(5)
    assert [deed(env, level) for level in range(5)] == [0, 0.25, 0.5, 0.75, 1]
    for same_level in (
        np.int64(3),
        np.array(3),
        np.array([3]),
        [3],
        torch.tensor(3),
        torch.tensor([3]),
    ):
        assert deed(env, same_level) == 0.75


def test_one_number_for_many_entries() -> None:
    """Every combination of levels, once."""
    one, many = (
        DiscretizeLevels(gymnasium.make(RATER), 3, multidiscrete) for multidiscrete in (False, True)
    )
    assert one.action_space == Discrete(27)
    assert many.action_space == MultiDiscrete([3, 3, 3])
    assert many.action(np.array([0, 1, 2])).tolist() == [0, 0.5, 1]
    combinations = {tuple(one.action(number).tolist()) for number in range(27)}
    assert combinations == {
        (a / 2, b / 2, c / 2) for a in range(3) for b in range(3) for c in range(3)
    }


@pytest.mark.parametrize(
    "action", [5, -1, 1.0, 2.5, np.nan, "2", None, [1, 2], np.array([0.0])], ids=repr
)
def test_what_is_no_level_is_refused_and_changes_nothing(action: Any) -> None:
    env, twin = (
        DiscretizeLevels(gymnasium.make(PROVIDER, noise=0.1), 5),
        DiscretizeLevels(gymnasium.make(PROVIDER, noise=0.1), 5),
    )
    for one in (env, twin):
        one.reset(seed=0)
    with refuses(ValueError, "action", "Discrete(5)"):
        env.step(action)
    assert same(env.step(4), twin.step(4))


@pytest.mark.parametrize(
    ("task_id", "levels", "words"),
    [
        (PROVIDER, 1, ("levels", "1")),
        (PROVIDER, 2.5, ("levels", "2.5")),
        (COLLUSION, 5, ("5", "21", "multidiscrete")),
    ],
)
def test_levels_that_cannot_be_are_refused(
    task_id: str, levels: Any, words: tuple[str, ...]
) -> None:
    with refuses(ValueError, levels, *words):
        DiscretizeLevels(gymnasium.make(task_id), levels)
    DiscretizeLevels(gymnasium.make(COLLUSION), 5, multidiscrete=True)


@pytest.mark.parametrize(
    "wrap",
    [RescaleClipAction, lambda env: DiscretizeLevels(env, 3)],
    ids=["RescaleClipAction", "DiscretizeLevels"],
)
def test_actions_that_are_not_ours_are_refused(wrap: Callable) -> None:
    with refuses(ValueError, "Box(-2.0, 2.0, (1,), float32)", "[0, 1]"):
        wrap(gymnasium.make("Pendulum-v1"))


def test_a_batch_can_be_wrapped_by_gymnasiums_own_vectoriser() -> None:
    batch = VectorizeTransformAction(
        gymnasium.make_vec(RATER, num_envs=2, noise=0.0), DiscretizeLevels, levels=3
    )
    scaled = VectorizeTransformAction(
        gymnasium.make_vec(RATER, num_envs=2, noise=0.0), RescaleClipAction
    )
    assert batch.action_space == MultiDiscrete([27, 27])
    batch.reset(seed=0)
    scaled.reset(seed=0)
    assert np.array_equal(
        batch.step(np.array([0, 26]))[0], scaled.step(np.array([[-3] * 3, [3] * 3]))[0]
    )


def test_dqn_learns_by_levels() -> None:
    sb3 = pytest.importorskip("stable_baselines3")
    env = DiscretizeLevels(gymnasium.make(PROVIDER, max_cycles=10), 3)
    model = sb3.DQN(
        "MlpPolicy", env, learning_starts=20, train_freq=10, seed=0, device="cpu"
    ).learn(60)
    action, _ = model.predict(env.reset(seed=0)[0])
    env.step(action)


# --- actions of many agents
# -------------------------------------------------------------------------


def each(scenario: str = "paper-3x3", **changes: Any) -> list[ParallelTransformAction]:
    wrappers: list[tuple[Any, dict]] = [
        (RescaleClipAction, {}),
        (DiscretizeLevels, {"levels": 2}),
        (ClipAction, {}),
    ]
    return [
        ParallelTransformAction(parallel_env(scenario, **changes), wrapper, **arguments)
        for wrapper, arguments in wrappers
    ]


@pytest.mark.parametrize("scenario", ["paper-3x3", "open-system", "peers"])
@pytest.mark.filterwarnings("ignore:Agents have different", "ignore:No agents present")
def test_pettingzoo_finds_nothing_wrong_with_each_agents_actions(scenario: str) -> None:
    for env in each(scenario, max_cycles=20)[:2]:
        parallel_api_test(env, num_cycles=30)


def test_each_agent_acts_through_its_own_wrapper() -> None:
    scaled, levels, clipped = each(noise=0.0)
    plain = parallel_env(noise=0.0)
    for env in (scaled, levels, clipped, plain):
        env.reset(seed=0)
    bits = {
        "sr_0": [0, 1, 1],
        "sr_1": [1, 0, 0],
        "sr_2": [1, 1, 1],
        "sp_0": [0],
        "sp_1": [1],
        "sp_2": [1],
    }
    numbers = {name: int("".join(map(str, digits)), 2) for name, digits in bits.items()}
    for _ in range(3):
        expected = plain.step({name: np.array(digits) for name, digits in bits.items()})
        assert data_equivalence(levels.step(numbers), expected)
        assert data_equivalence(
            scaled.step({n: 9.0 * np.array(digits) - 4 for n, digits in bits.items()}), expected
        )
        assert data_equivalence(
            clipped.step({n: 9.0 * np.array(digits) - 4 for n, digits in bits.items()}), expected
        )


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        ({"sp_0": 9}, ("sp_0", "Discrete(3)")),
        ({"sp_0": None}, ("sp_0", "Discrete(3)")),
        ({"sr_0": [0, 1]}, ("sr_0", "Discrete(27)")),
        ({"sr_0": torch.zeros(3, requires_grad=True)}, ("sr_0",)),
        ({"robin": 0}, ("robin", "sr_0")),
    ],
    ids=str,
)
def test_a_bad_action_of_an_agent_is_refused_by_name(spoil: dict, words: tuple[str, ...]) -> None:
    env = ParallelTransformAction(parallel_env(), DiscretizeLevels, levels=3)
    env.reset(seed=0)
    before = env.state()
    actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    with refuses(ValueError, *words):
        env.step(actions | spoil)
    assert np.array_equal(env.state(), before)
    del actions["sr_1"]
    with refuses(ValueError, "sr_1"):
        env.step(actions)


# --- everybody
# --------------------------------------------------------------------------------------


def sampled(env: Any) -> dict[str, np.ndarray]:
    return {agent: env.action_space(agent).sample() for agent in env.agents}


@pytest.mark.filterwarnings("ignore:Agents have different", "ignore:Observations are different")
def test_pettingzoo_finds_nothing_wrong_with_everybody() -> None:
    for changes in (COME_AND_GO, {}):
        parallel_api_test(FixedAgents(parallel_env("open-system", **changes)), num_cycles=30)
        parallel_seed_test(
            lambda changes=changes: FixedAgents(parallel_env("open-system", **changes)),
            num_cycles=10,
        )


def test_everybody_is_in_every_dictionary_with_what_they_have() -> None:
    plain, env = (
        parallel_env("open-system", **COME_AND_GO),
        FixedAgents(parallel_env("open-system", **COME_AND_GO)),
    )
    seen, _ = plain.reset(seed=1)
    observations, infos = env.reset(seed=1)
    here = [[agent for agent in infos if infos[agent]["present"]]]
    while plain.agents:
        assert env.agents == env.possible_agents
        for agent in env.possible_agents:
            assert observations[agent] in env.observation_space(agent)
            assert np.array_equal(observations[agent], seen.get(agent, 0 * observations[agent]))
        actions = sampled(env)
        seen, earned, *_ = plain.step({agent: actions[agent] for agent in plain.agents})
        observations, rewards, terminations, truncations, infos = env.step(actions)
        for part in (observations, rewards, terminations, truncations, infos):
            assert list(part) == env.possible_agents
        assert rewards == dict.fromkeys(env.possible_agents, 0.0) | earned
        assert not any(terminations.values())
        assert set(truncations.values()) == {not plain.agents}
        here.append([agent for agent in infos if infos[agent]["present"]])
    assert env.agents == []
    first = ["sr_0", "sr_1", "sp_0", "srsp_0"]
    joined, left = ["sr_0", "sr_1", "sp_0", "sp_1", "srsp_0"], ["sr_0", "sr_1", "sp_0", "sp_1"]
    assert here == [first, first, joined, left, left, left]


def test_the_actions_of_absent_agents_are_ignored() -> None:
    env, twin = (FixedAgents(parallel_env("open-system", **COME_AND_GO)) for _ in range(2))
    env.reset(seed=0)
    twin.reset(seed=0)
    actions = sampled(env)
    others = actions | {"sp_1": np.array([np.nan])}
    assert data_equivalence(env.step(others), twin.step(actions))
    del actions["sp_0"]
    with refuses(ValueError, "sp_0"):
        env.step(actions)
    with refuses(ValueError, "robin"):
        env.step(sampled(env) | {"robin": np.zeros(1)})


def test_it_ends_for_all_when_nobody_is_left() -> None:
    agents = [{"role": "SR", "leaves": 3}, {"role": "SP", "leaves": 2}, {"role": "SP", "joins": 8}]
    env = FixedAgents(parallel_env(agents=agents, max_cycles=9))
    env.reset(seed=0)
    ends = []
    while env.agents:
        _, _, terminations, truncations, _ = env.step(sampled(env))
        ends.append((set(terminations.values()), set(truncations.values())))
    assert ends == [({False}, {False})] * 2 + [({True}, {False})]
    assert env.step({}) == ({}, {}, {}, {}, {})
    with refuses(RuntimeError, "reset()"):
        env.step({"sr_0": np.zeros(2)})


DUPLICATES = [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))]


@pytest.mark.parametrize("duplicate", DUPLICATES, ids=["copy", "pickle"])
@pytest.mark.parametrize(
    "wrap",
    [
        FixedAgents,
        lambda env: ParallelTransformAction(FixedAgents(env), RescaleClipAction),
        lambda env: ParallelTransformAction(env, DiscretizeLevels, levels=3),
    ],
)
def test_a_copy_plays_on_alike(wrap: Callable, duplicate: Callable) -> None:
    env = wrap(parallel_env("open-system", **COME_AND_GO))
    env.reset(seed=0)
    actions = sampled(env)
    twin = duplicate(env)
    assert data_equivalence(twin.step(actions), env.step(actions))
