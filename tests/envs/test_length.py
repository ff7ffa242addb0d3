"""Games that end at random: in every environment after a round with the same chance, and untold."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import api_test, parallel_api_test
from refusals import refuses

import roletrust_env
from roletrust_env import Game, Scenario, make_scenario, make_task
from roletrust_env.envs.sb3 import AttackVecEnv, RoleVecEnv
from roletrust_env.envs.vector import ProviderAttackVectorEnv

GOES_ON, MOST = 0.8, 6
ID = "RoleTrust/ProviderAttack-v0"
COMING = [
    {"role": "SR", "count": 3, "noise": 0.1},
    {"role": "SP", "count": 3},
    {"role": "SP", "joins": 1, "leaves": 3},
]


def check_lengths(ends: np.ndarray, cut: np.ndarray) -> None:
    """Check the numbers of rounds of many episodes, and whether they were truncated, by their
    distribution."""
    scenario = make_scenario("paper-3x3").change(continuation=GOES_ON, max_cycles=MOST)
    for lengths, mean in ((ends, scenario.mean_length), (cut, GOES_ON**MOST)):
        assert abs(lengths.mean() - mean) < 4 * lengths.std() / len(lengths) ** 0.5
    assert ends.max() == MOST
    assert np.all(ends[cut] == MOST)
    assert not np.all(cut[ends == MOST])  # some end at random just then


def test_an_end_is_a_termination_of_all_agents() -> None:
    scenario = Scenario(agents=COMING, max_cycles=MOST, continuation=GOES_ON)
    env, endless = (
        roletrust_env.parallel_env(scenario.change(continuation=c)) for c in (GOES_ON, 1.0)
    )
    ends, cut = [], []
    for seed in range(60):
        seen = [one.reset(seed=seed)[0] for one in (env, endless)]
        ends.append(0)
        while env.agents:
            for agent, observation in seen[0].items():
                np.testing.assert_array_equal(observation, seen[1][agent])
            actions = {agent: env.action_space(agent).sample() for agent in env.agents}
            played, other = env.step(actions), endless.step(actions)
            seen = [played[0], other[0]]
            ends[-1] += 1
            assert played[1] == {agent: other[1][agent] for agent in played[1]}
            assert played[2:4] == other[2:4] or not env.agents
        cut.append(any(played[3].values()))
        assert set(played[0]) >= set(actions)
        assert all(played[2][agent] != played[3][agent] for agent in played[0])
        assert cut[-1] or all(played[2].values())
    check_lengths(np.array(ends), np.array(cut))


def test_the_checkers_of_pettingzoo_and_gymnasium() -> None:
    scenario = Scenario(agents=COMING, max_cycles=30, continuation=0.9)
    parallel_api_test(roletrust_env.parallel_env(scenario), 100)
    api_test(roletrust_env.env(scenario), 100)
    check_env(gymnasium.make(ID, continuation=0.9).unwrapped, skip_render_check=True)


def test_a_task_ends_by_its_seed_and_has_the_same_rounds_until_then() -> None:
    env, endless = (gymnasium.make(ID, max_cycles=MOST, continuation=c) for c in (GOES_ON, 1.0))
    ends, cut = [], []
    for seed in [*range(150), *range(20)]:
        np.testing.assert_array_equal(env.reset(seed=seed)[0], endless.reset(seed=seed)[0])
        terminated = truncated = False
        while not terminated and not truncated:
            played, other = (
                env.step(np.array([0.3], np.float32)),
                endless.step(np.array([0.3], np.float32)),
            )
            np.testing.assert_array_equal(played[0], other[0])
            assert played[1] == other[1]
            terminated, truncated = played[2:4]
        ends.append(round(other[0][0] * MOST))
        cut.append(truncated)
        with refuses(RuntimeError, "reset()"):
            env.step(np.array([0.3], np.float32))
    assert ends[150:] == ends[:20]
    check_lengths(np.array(ends[:150]), np.array(cut[:150]))


class Lengths:
    """The lengths of the first two episodes of each slot, which do not depend on when one stops
    looking."""

    def __init__(self, slots: int) -> None:
        self.begun, self.playing = np.zeros(slots, int), np.zeros(slots, int)
        self.ends, self.cut = np.zeros((2, slots), int), np.zeros((2, slots), bool)

    def add(self, plays: np.ndarray, dones: np.ndarray, truncated: np.ndarray) -> None:
        self.playing += plays
        counted = np.flatnonzero(dones & (self.begun < 2))
        self.ends[self.begun[counted], counted] = self.playing[counted]
        self.cut[self.begun[counted], counted] = truncated[counted]
        self.begun += dones
        self.playing[dones] = 0

    def check(self) -> None:
        assert self.begun.min() >= 2
        check_lengths(self.ends.ravel(), self.cut.ravel())
        assert abs(np.corrcoef(self.ends)[0, 1]) < 0.2  # the episodes of a slot are independent


@pytest.mark.parametrize("arguments", [{}, {"autoreset_mode": "SameStep"}], ids=str)
def test_the_games_of_a_vector_end_one_by_one(arguments: dict[str, Any]) -> None:
    games, same = 400, "autoreset_mode" in arguments
    env, endless = (
        ProviderAttackVectorEnv(games, max_cycles=MOST, continuation=c, **arguments)
        for c in (GOES_ON, 1.0)
    )
    np.testing.assert_array_equal(*(one.reset(seed=1)[0] for one in (env, endless)))
    lengths, ended, action = (
        Lengths(games),
        np.zeros(games, bool),
        np.full((games, 1), 0.3, np.float32),
    )
    for t in range(2 * MOST + 1):
        plays = ~ended | same
        seen, reward, terminated, truncated, _ = env.step(action)
        assert not np.any(terminated & truncated)
        ended = terminated | truncated
        if t == 0:  # a new game then takes random numbers that all have
            other, paid, *_ = endless.step(action)
            np.testing.assert_array_equal(reward, paid)
            np.testing.assert_array_equal(seen[~ended], other[~ended])
        lengths.add(plays, ended, truncated)
    lengths.check()


def test_learners_of_stable_baselines_do_not_look_behind_an_end() -> None:
    like = np.zeros((), np.float32)
    task = make_task("paper-3x3", ("sp_2",), max_cycles=MOST, continuation=GOES_ON, like=like)
    game = Game(make_scenario("paper-3x3").change(max_cycles=MOST, continuation=GOES_ON), like=like)
    for env, slots in (
        (AttackVecEnv(task, 400, seed=3), slice(400)),
        (RoleVecEnv(game, "sr", 400, seed=3), slice(400)),
    ):
        env.reset()
        lengths = Lengths(400)
        for _ in range(2 * MOST):
            seen, _, dones, infos = env.step(
                np.zeros((env.num_envs, *env.action_space.shape), np.float32)
            )
            assert [info["episode"]["l"] for info in infos[slots] if "episode" in info] == (
                lengths.playing[dones[slots]] + 1
            ).tolist()
            truncated = np.array([info.get("TimeLimit.truncated", False) for info in infos])
            lengths.add(np.ones(400, bool), dones[slots], truncated[slots])
            assert np.all((seen[:, 0] == 0) == dones)
            assert np.all(dones.reshape(-1, 400) == dones[slots])
        lengths.check()
