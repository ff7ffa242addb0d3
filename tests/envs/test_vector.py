"""The batched face against single games: one, many, both ways to restart them, and torch."""

import copy

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from slow_vector import GAMES, Loop
from vector_cases import (
    ENDS,
    EVERY_MODE,
    EVERY_TASK,
    RATER,
    TOLERANCE,
    acts,
    assert_close,
    lies,
    same,
)

from roletrust_env import Scenario
from roletrust_env.envs.vector import AttackVectorEnv

# --- one game
# ---------------------------------------------------------------------------------------


@EVERY_TASK
@EVERY_MODE
def test_a_batch_of_one_is_the_single_environment(task_id: str, mode: AutoresetMode) -> None:
    """Step for step with one seed, through four episodes."""
    arguments = {
        "max_cycles": 7,
        "noise": 0.1,
        "knowledge": "grey_box",
        "stealth": {"weight": 1.0, "tolerance": 0.0},
    }
    batch = gymnasium.make_vec(task_id, num_envs=1, autoreset_mode=mode, **arguments)
    single = gymnasium.make(task_id, **arguments)
    observation, _ = single.reset(seed=11)
    assert_close(batch.reset(seed=11)[0][0], observation)
    ended = False
    for t, action in enumerate(acts(batch, 30)):
        if ended and mode is AutoresetMode.NEXT_STEP:
            observation, info = single.reset()
            reward, terminated, truncated = 0.0, False, False
        else:
            observation, reward, terminated, truncated, info = single.step(action[0])
        ended = terminated or truncated
        observations, rewards, terminations, truncations, infos = batch.step(action)
        if ended and mode is AutoresetMode.SAME_STEP:
            assert_close(infos["final_obs"][0], observation)
            assert_close([infos["final_info"][name][0] for name in info], list(info.values()))
            observation, _ = single.reset()
        else:
            assert not any(name.startswith("final") for name in infos)
            assert_close([infos[name][0] for name in info], list(info.values()))
        np.testing.assert_allclose(observations[0], observation, **TOLERANCE, err_msg=f"step {t}")
        assert rewards[0] == pytest.approx(reward, abs=2e-6)
        assert (terminations[0], truncations[0]) == (terminated, truncated)


@EVERY_MODE
def test_it_is_what_gymnasium_makes_of_the_single_environment(mode: AutoresetMode) -> None:
    """The infos, too, each with its mask."""
    arguments = {"max_cycles": 4, "noise": 0.1}
    batch = gymnasium.make_vec(RATER, num_envs=1, autoreset_mode=mode, **arguments)
    loop = SyncVectorEnv([lambda: gymnasium.make(RATER, **arguments)], autoreset_mode=mode)
    infos, wanted = batch.reset(seed=2)[1], loop.reset(seed=2)[1]
    assert set(infos) == set(wanted)
    for action in acts(batch, 14):
        *steps, infos = batch.step(action)
        *expected, wanted = loop.step(action)
        for actual, value in zip(steps, expected, strict=True):
            assert_close(actual, value)
        assert set(infos) == set(wanted)
        for name in ("objective", "cost", "_objective", "_cost"):
            assert_close(infos[name], wanted[name])
        if "final_info" in wanted:
            assert set(infos["final_info"]) == set(wanted["final_info"])
            for name in wanted["final_info"]:
                assert_close(infos["final_info"][name], wanted["final_info"][name])
            assert_close(infos["final_obs"][0], wanted["final_obs"][0])


# --- many games
# -------------------------------------------------------------------------------------


@EVERY_MODE
def test_games_restart_as_single_games_do(mode: AutoresetMode) -> None:
    batch = gymnasium.make_vec(RATER, num_envs=GAMES, autoreset_mode=mode, **ENDS)
    observations, _ = batch.reset(seed=4)
    loop = Loop(batch.task, mode, 4)
    assert_close(observations, loop.observe())
    kinds = set()
    for actions in lies(GAMES, 60, 4):
        expected = loop.step(actions)
        observations, rewards, terminations, truncations, infos = batch.step(actions)
        assert_close(observations, expected["observation"])
        assert_close(rewards, expected["reward"])
        assert_close(terminations, expected["terminated"])
        assert_close(truncations, expected["truncated"])
        ended, finals = expected["ended"], {"final_obs", "final_info", "_final_obs", "_final_info"}
        final = infos
        if mode is AutoresetMode.SAME_STEP and ended.any():
            assert finals < set(infos)
            assert infos["_final_obs"].tolist() == infos["_final_info"].tolist() == ended.tolist()
            assert_close(np.array(list(infos["final_obs"]))[ended], expected["final_obs"][ended])
            final = infos["final_info"]
            assert final["_objective"].tolist() == final["_cost"].tolist() == ended.tolist()
        else:
            assert not finals & set(infos)
        for name in ("objective", "cost"):
            goes_on = ~ended if mode is AutoresetMode.SAME_STEP else np.full(GAMES, True)
            assert_close(infos[name][goes_on], expected[name][goes_on])
            assert_close(final[name][ended], expected[name][ended])
        kinds |= {(int(terminations.sum()), int(truncations.sum()), int(expected["waits"].sum()))}
    assert any(terminated and not truncated for terminated, truncated, _ in kinds)
    assert any(truncated for _, truncated, _ in kinds)
    assert any(waiting for *_, waiting in kinds) == (mode is AutoresetMode.NEXT_STEP)


def test_the_step_that_restarts_a_game_ignores_its_action() -> None:
    batch, twin = (gymnasium.make_vec(RATER, num_envs=GAMES, **ENDS) for _ in range(2))
    batch.reset(seed=0)
    twin.reset(seed=0)
    ended, restarts = np.full(GAMES, False), 0
    for actions in lies(GAMES, 40, 4):
        other = np.where(ended[:, None], 1 - actions, actions)
        step = batch.step(actions)
        assert same(step, twin.step(other))
        observations, rewards, terminations, truncations, infos = step
        for values in (rewards, terminations, truncations, infos["objective"], infos["cost"]):
            assert not values[ended].any()
        assert np.all(observations[ended, 0] == 0)  # the round
        restarts += ended.sum()
        ended = terminations | truncations
    assert restarts > 8


def test_same_step_rewards_and_infos_are_of_the_games_that_they_belong_to() -> None:
    """In the step that restarts a game its reward is of the last round, and its infos are of the
    new episode."""
    batch = gymnasium.make_vec(
        RATER, num_envs=3, autoreset_mode=AutoresetMode.SAME_STEP, max_cycles=3
    )
    batch.reset(seed=0)
    for actions in acts(batch, 3):
        observations, rewards, _, truncations, infos = batch.step(actions)
    assert truncations.all()
    assert np.all(rewards > 0)
    assert_close(infos["final_info"]["objective"], rewards)
    assert np.all(infos["final_obs"][:, 0] == 1)
    assert np.all(observations[:, 0] == 0)
    assert not infos["objective"].any()


@EVERY_MODE
def test_caught_in_the_last_round_is_no_truncation(mode: AutoresetMode) -> None:
    agents = [{"role": "SR"}, {"role": "SR", "leaves": 3}, {"role": "SP"}]
    world = {"scenario": Scenario(agents=agents, max_cycles=3), "compromised": ("sr_1",)}
    batch = AttackVectorEnv(RATER, 2, autoreset_mode=mode, **world)
    batch.reset(seed=0)
    steps = [batch.step(actions) for actions in acts(batch, 3)]
    assert [terminations.tolist() for _, _, terminations, _, _ in steps] == [[False] * 2] * 2 + [
        [True] * 2
    ]
    assert not any(truncations.any() for *_, truncations, _ in steps)


@pytest.mark.parametrize("level", ["black_box", "grey_box", "white_box"])
@EVERY_TASK
def test_a_thousand_games_stay_in_their_spaces(task_id: str, level: str) -> None:
    batch = gymnasium.make_vec(
        task_id, num_envs=1024, knowledge=level, stealth={"weight": 1.0}, max_cycles=5
    )
    observations, _ = batch.reset(seed=0)
    rows = []
    for actions in acts(batch, 7):
        assert batch.observation_space.contains(observations)
        assert observations.flags.c_contiguous
        observations, rewards, terminations, truncations, infos = batch.step(actions)
        for row in (rewards, terminations, truncations, *infos.values()):
            assert row.shape == (1024,)
        assert rewards.dtype == np.float64
        assert terminations.dtype == truncations.dtype == bool
        rows.append(rewards)
    assert observations.shape == (1024, *batch.single_observation_space.shape)
    assert np.unique(rows[3]).size > 500
    assert not rows[5].any()  # all begin anew


@EVERY_MODE
def test_what_was_handed_out_stays_as_it_was(mode: AutoresetMode) -> None:
    batch = gymnasium.make_vec(RATER, num_envs=GAMES, autoreset_mode=mode, **ENDS)
    handed, kept = [batch.reset(seed=0)], []
    kept.append(copy.deepcopy(handed[0]))
    for actions in lies(GAMES, 25, 4):
        handed.append(batch.step(actions))
        kept.append(copy.deepcopy(handed[-1]))
        actions[:] = np.nan
    assert same(tuple(handed), tuple(kept))


# --- torch
# ------------------------------------------------------------------------------------------


@EVERY_MODE
def test_torch_plays_as_numpy_does(mode: AutoresetMode) -> None:
    batch = AttackVectorEnv(RATER, GAMES, autoreset_mode=mode, **ENDS)
    observations, _ = batch.reset(seed=5)
    like = torch.zeros((), dtype=torch.float64)
    tensors = AttackVectorEnv(RATER, GAMES, autoreset_mode=mode, like=like, **ENDS)
    assert_close(tensors.reset(seed=5)[0], observations)
    ends = 0
    for t, actions in enumerate(lies(GAMES, 50, 4)):
        expected = batch.step(actions)
        played = tensors.step(torch.asarray(actions) if t % 2 else actions)
        for part, value in zip(played[:4], expected[:4], strict=True):
            assert isinstance(part, torch.Tensor)
            assert str(part.dtype) == f"torch.{value.dtype}"
            assert_close(part, value)
        assert played[0].is_contiguous()
        assert set(played[4]) == set(expected[4])
        for name in set(expected[4]) - {"final_info"}:
            assert_close(played[4][name], expected[4][name])
        if "final_info" in expected[4]:
            for name, value in expected[4]["final_info"].items():
                assert_close(played[4]["final_info"][name], value)
        ends += int((expected[2] | expected[3]).sum())
    assert ends > 10


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_observations_are_of_the_observation_space(dtype: type) -> None:
    batch = AttackVectorEnv(RATER, 3, like=np.zeros((), dtype))
    assert batch.observation_space.contains(batch.reset(seed=0)[0])
    assert batch.observation_space.contains(batch.step(acts(batch, 1)[0])[0])
