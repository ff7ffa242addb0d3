"""PettingZoo's own tests on every preset, and what they are blind to."""

import warnings
from collections.abc import Callable, Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pettingzoo
import pytest
from gymnasium.utils.env_checker import data_equivalence
from pettingzoo.test import (
    api_test,
    max_cycles_test,
    parallel_api_test,
    parallel_seed_test,
    seed_test,
)
from pettingzoo.utils.conversions import parallel_to_aec
from refusals import refuses

import roletrust_env
from roletrust_env import RoleTrustParallelEnv, Scenario

# A preset, and the length to play where its own would take too long here.
LENGTHS: dict[str, int | None] = dict.fromkeys(
    name for name in roletrust_env.scenarios() if name != "city"
)
LENGTHS |= {
    "paper-3x3": 60,
    "crowd-100x100": 2,
    "crowd-10x10": 12,
    "paper-3x3-hog": 1,
    "robots-that-move": 60,
}
LENGTHS |= {"market": 20, "subjective": 12, "newcomers": 62, "peers": 20}

Make = Callable[..., RoleTrustParallelEnv]


@pytest.fixture(
    params=[
        pytest.param(name, marks=pytest.mark.slow) if name.endswith("hog") else name
        for name in LENGTHS
    ]
)
def preset(request: pytest.FixtureRequest) -> str:
    if request.param.endswith("hog"):
        pytest.importorskip("cv2")
    return request.param


@pytest.fixture
def options(preset: str) -> dict[str, Any]:
    return {} if LENGTHS[preset] is None else {"max_cycles": LENGTHS[preset]}


@pytest.fixture
def make(preset: str, options: dict[str, Any]) -> Make:
    return partial(roletrust_env.parallel_env, preset, **options)


@pytest.fixture
def make_aec(preset: str, options: dict[str, Any]) -> Callable[[], Any]:
    return partial(roletrust_env.env, preset, **options)


@pytest.fixture(autouse=True)
def _no_warnings() -> Iterator[None]:
    """All but one, which a game with two roles cannot help."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "Agents have different observation space sizes")
        warnings.filterwarnings("ignore", "Observations are different shapes")
        yield


def test_parallel_api(make: Make) -> None:
    parallel_api_test(make(), num_cycles=1000)


def test_api(make_aec: Callable) -> None:
    api_test(make_aec(), num_cycles=60)


def test_seeds(make: Make, make_aec: Callable) -> None:
    parallel_seed_test(make, num_cycles=50)
    seed_test(make_aec, num_cycles=20)


def test_max_cycles() -> None:
    max_cycles_test(SimpleNamespace(parallel_env=roletrust_env.parallel_env, env=roletrust_env.env))


def episode(env: RoleTrustParallelEnv, seed: int | None) -> Iterator[tuple]:
    """Everything that a whole episode of random play returns, `state()` and `agents` included."""
    yield (*env.reset(seed=seed), list(env.agents), env.state())
    while env.agents:
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        yield (actions, *env.step(actions), list(env.agents), env.state())


def bits(value: Any) -> Any:
    """A value that is equal to another if and only if all their bits are."""
    if isinstance(value, dict):
        return {key: bits(inner) for key, inner in value.items()}
    if isinstance(value, tuple | list):
        return [bits(inner) for inner in value]
    return (
        (value.dtype.str, value.shape, value.tobytes())
        if isinstance(value, np.ndarray)
        else repr(value)
    )


def test_two_runs_of_one_seed_are_equal_to_the_last_bit(make: Make) -> None:
    used = make()
    for _ in zip(range(2), episode(used, seed=99), strict=False):
        pass  # an episode broken off leaves nothing behind
    runs = [list(map(bits, episode(env, seed=4))) for env in (make(), used)]
    assert runs[0] == runs[1]
    assert runs[0] != list(map(bits, episode(make(), seed=5)))


def test_an_episode_without_a_seed_goes_on_with_the_same_luck(make: Make) -> None:
    def third_episode() -> list:
        env = make(max_cycles=1)
        for seed in (5, None, None):
            *_, last = map(bits, episode(env, seed))
        return last

    assert third_episode() == third_episode()


def test_whole_episodes_lie_in_their_spaces(make: Make) -> None:
    env = make()
    spaces = {
        agent: (env.observation_space(agent), env.action_space(agent))
        for agent in env.possible_agents
    }
    gone: set[str] = set()
    playing: list[str] = []
    for *returned, agents, state in episode(env, seed=1):
        assert state.dtype == np.float32
        assert env.state_space.contains(state)
        if len(returned) == 2:
            observations, infos = returned
            assert set(observations) == set(infos) == set(agents)
        else:
            _, observations, rewards, terminations, truncations, infos = returned
            for part in (observations, rewards, terminations, truncations, infos):
                assert set(playing) <= set(part)
                assert set(part) == set(observations)
            assert all(type(reward) is float and np.isfinite(reward) for reward in rewards.values())
            assert all(
                type(flag) is bool for flag in (*terminations.values(), *truncations.values())
            )
            ended = {agent for agent in terminations if terminations[agent] or truncations[agent]}
            assert not any(terminations[agent] and truncations[agent] for agent in terminations)
            assert set(agents) == set(observations) - ended
            assert all("fate" in infos[agent] for agent in terminations if terminations[agent])
            gone |= ended
        assert not gone & set(agents)
        playing = agents
        for agent, observation in observations.items():
            assert observation.dtype == np.float32
            assert spaces[agent][0].contains(observation), agent
            assert env.observation_space(agent) is spaces[agent][0]
            assert env.action_space(agent) is spaces[agent][1]


def test_what_is_handed_out_is_a_copy(make: Make) -> None:
    env, twin = make(), make()
    handed = env.reset(seed=1)
    twin.reset(seed=1)
    for _ in range(2):
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        same = {agent: action.copy() for agent, action in actions.items()}
        for array in [
            *handed[0].values(),
            *(v for i in handed[-1].values() for v in i.values()),
            env.state(),
        ]:
            if isinstance(array, np.ndarray):
                array[:] = 0.123
        handed = env.step(actions)
        for action in actions.values():
            action[:] = 0.456
        assert data_equivalence(handed, twin.step(same))
        assert np.array_equal(env.state(), twin.state())


def test_aec_and_parallel_play_the_same_game(make: Make, make_aec: Callable) -> None:
    env, aec = make(), make_aec()
    observations, _ = env.reset(seed=3)
    aec.reset(seed=3)
    for _ in range(20):
        if not env.agents:
            break
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        agents = list(env.agents)
        observations, rewards, terminations, truncations, _ = env.step(actions)
        for agent in agents:
            while aec.agent_selection != agent:  # the dead step first
                aec.step(None)
            aec.step(actions[agent])
        assert np.array_equal(aec.state(), env.state())
        for agent in observations:
            assert np.array_equal(aec.observe(agent), observations[agent])
            assert (aec.terminations[agent], aec.truncations[agent]) == (
                terminations[agent],
                truncations[agent],
            )
            assert aec.rewards[agent] == rewards[agent]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_agents_may_share_an_array_for_their_actions(dtype: Any) -> None:
    groups = [{"role": "SP", "count": 2}, {"role": "SR", "count": 1}]
    for late in ([], [{"role": "SP", "joins": 2}]):
        one, shared = (
            roletrust_env.env(Scenario(agents=[*groups, *late], max_cycles=4)) for _ in range(2)
        )
        one.reset(seed=1)
        shared.reset(seed=1)
        array = np.empty(3 if late else 2, dtype)
        for k in range(12):
            action = np.full(one.action_space(one.agent_selection).shape, k / 12, np.float32)
            array[...] = k / 12
            one.step(action)
            shared.step(array[: len(action)])
            assert np.array_equal(one.state(), shared.state())


def test_aec_takes_turns_as_pettingzoo_does() -> None:
    rater = {"role": "SR", "noise": 0.2}
    late = [
        {"role": "SR", "joins": 3, "leaves": 9},
        {"role": "SP", "join_rate": 0.2, "leave_rate": 0.2, "count": 3},
    ]
    scenario = {
        "agents": [rater | {"count": 2}, rater | {"leaves": 5}, {"role": "SP"}, *late],
        "max_cycles": 20,
    }
    aec, twin = (
        roletrust_env.env(**scenario),
        parallel_to_aec(roletrust_env.parallel_env(**scenario)),
    )
    for seed in range(3):
        for env in (aec, twin):
            env.reset(seed=seed)
        for agent in twin.agent_iter():
            names = ("agents", "agent_selection", "rewards", "terminations", "truncations", "infos")
            seen, wanted = ([bits(getattr(env, name)) for name in names] for env in (aec, twin))
            assert seen == wanted
            assert bits(aec.last()) == bits(twin.last())
            *_, terminated, truncated, _ = twin.last()
            action = None if terminated or truncated else twin.action_space(agent).sample()
            for env in (aec, twin):
                env.step(action)
        assert aec.agents == []


def test_aec_refuses_a_bad_action_at_once() -> None:
    """Not when the last agent has acted, when it is too late to act otherwise."""
    aec, twin = roletrust_env.env(), roletrust_env.env()
    for env in (aec, twin):
        env.reset(seed=0)
    with refuses(ValueError, "sr_0", "[0, 1]"):
        aec.step(np.full(3, 9, np.float32))
    for agent in twin.agents:
        action = twin.action_space(agent).sample()
        twin.step(action)
        aec.step(action)
    assert np.array_equal(aec.state(), twin.state())


def test_aec_takes_an_action_of_the_right_size() -> None:
    aec, twin = roletrust_env.env(), roletrust_env.env()
    for env in (aec, twin):
        env.reset(seed=0)
    for agent in twin.agents:
        action = twin.action_space(agent).sample()
        twin.step(action)
        aec.step(action.tolist() if agent.startswith("sr") else action.squeeze())
    assert np.array_equal(aec.state(), twin.state())


def test_aec_plays_to_the_end_when_somebody_would_come_then() -> None:
    aec = roletrust_env.env(
        agents=[{"role": "SR"}, {"role": "SP"}, {"role": "SR", "joins": 2}], max_cycles=2
    )
    aec.reset(seed=0)
    for agent in aec.agent_iter():
        *_, terminated, truncated, _ = aec.last()
        aec.step(None if terminated or truncated else aec.action_space(agent).sample())
    assert not aec.agents


def test_the_registry_knows_both_faces() -> None:
    parallel = pettingzoo.make("parallel", "RoleTrust-v0", scenario="crowd-10x10", max_cycles=7)
    aec = pettingzoo.make("aec", "RoleTrust-v0", scenario="peers", trust_model="mean")
    assert isinstance(parallel.unwrapped, RoleTrustParallelEnv)
    assert len(parallel.possible_agents) == 20
    assert parallel.unwrapped.game.scenario.max_cycles == 7
    aec.reset(seed=0)
    assert aec.agent_selection == "srsp_0"
    assert pettingzoo.make("parallel", "RoleTrust-v0").possible_agents[0] == "sr_0"


def test_aec_refuses_an_episode_that_does_not_begin_or_go_on() -> None:
    aec = roletrust_env.env(max_cycles=1)
    for what in (
        lambda: aec.step(None),
        aec.last,
        lambda: aec.agents,
        lambda: list(aec.agent_iter()),
    ):
        with refuses(AttributeError, "reset()"):
            what()
    aec.reset(seed=0)
    with refuses(RuntimeError, "step()"):
        list(aec.agent_iter())
    for agent in list(aec.agents):
        aec.step(aec.action_space(agent).sample())
    for _ in [*aec.agents, "nobody"]:  # at last with a warning of PettingZoo
        aec.step(None)
    assert aec.agents == []


def test_aec_takes_no_action_for_none_and_none_for_no_action() -> None:
    aec = roletrust_env.env(max_cycles=1)
    aec.reset(seed=0)
    with refuses(ValueError, "sr_0"):
        aec.step(None)
    for agent in list(aec.agents):
        aec.step(aec.action_space(agent).sample())
    with refuses(ValueError, "sp_0"):
        aec.step(aec.action_space(aec.agent_selection).sample())
