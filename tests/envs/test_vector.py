"""The batched face against single games: one, many, both ways to restart them, torch; and what is refused."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import vector as wrappers
from slow_vector import GAMES, Loop

from baselines import OnOff
from roletrust_env import Scenario
from roletrust_env.envs.tasks import TASKS
from roletrust_env.envs.vector import AttackVectorEnv

MODES = [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP]
EVERY_MODE = pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name.lower())
EVERY_TASK = pytest.mark.parametrize("task_id", TASKS)
RATER = "RoleTrust/RaterAttack-v0"
TOLERANCE = {"rtol": 0, "atol": 2e-6}

# Of eight games that rate ever better the worst are cut off, sooner or later, and the others go on to the end.
AGENTS = [{"role": "SR", "count": 4, "noise": 0.1}, {"role": "SP", "count": 3}, {"role": "SR+SP", "noise": 0.2}]
ENDS = {
    "scenario": Scenario(
        agents=AGENTS,
        access={"kind": "choice", "providers": 3, "temperature": 0.5},
        ratings={"late": 0.2, "lost": 0.1, "delay": 2},
        admission={"threshold": 0.3, "rounds": 3},
        max_cycles=17,
    ),
    "compromised": ("sr_1",),
    "stealth": {"weight": 2.0, "tolerance": 0.1},
    "others": {"sp_1": OnOff(switching="random", period=6)},
    "knowledge": "white_box",
}


def lies(games: int, steps: int, size: int, seed: int = 0) -> list[np.ndarray]:
    """Actions of every step, (E, A): from the worst to the best, with a little of everything."""
    spread = np.linspace(0, 1, games)[:, None]
    random = np.random.default_rng(seed).random((steps, games, size))
    return list((0.9 * spread + 0.1 * random).astype(np.float32))


def acts(env: AttackVectorEnv, steps: int, seed: int = 0) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).random((steps, *env.action_space.shape), dtype=np.float32))


def same(a: tuple, b: tuple) -> bool:
    return data_equivalence(a, b, exact=True)


def assert_close(actual: Any, expected: Any) -> None:
    np.testing.assert_allclose(np.asarray(actual), np.asarray(expected), **TOLERANCE)


# --- one game ---------------------------------------------------------------------------------------


@EVERY_TASK
@EVERY_MODE
def test_a_batch_of_one_is_the_single_environment(task_id: str, mode: AutoresetMode) -> None:
    """Step for step with one seed, through four episodes."""
    arguments = {"max_cycles": 7, "noise": 0.1, "knowledge": "grey_box", "stealth": {"weight": 1.0, "tolerance": 0.0}}
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
    """The infos, too; Gymnasium adds to each its mask, which says that every game has one."""
    arguments = {"max_cycles": 4, "noise": 0.1}
    batch = gymnasium.make_vec(RATER, num_envs=1, autoreset_mode=mode, **arguments)
    loop = SyncVectorEnv([lambda: gymnasium.make(RATER, **arguments)], autoreset_mode=mode)
    infos, wanted = batch.reset(seed=2)[1], loop.reset(seed=2)[1]
    assert set(infos) == {name for name in wanted if name not in ("_objective", "_cost")}
    for action in acts(batch, 14):
        *steps, infos = batch.step(action)
        *expected, wanted = loop.step(action)
        for actual, value in zip(steps, expected, strict=True):
            assert_close(actual, value)
        assert set(infos) == {name for name in wanted if name not in ("_objective", "_cost")}
        for name in ("objective", "cost"):
            assert_close(infos[name], wanted[name])
        if "final_info" in wanted:
            assert_close(infos["final_info"]["objective"], wanted["final_info"]["objective"])
            assert_close(infos["final_obs"][0], wanted["final_obs"][0])


# --- many games -------------------------------------------------------------------------------------


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
    """In the step that restarts a game its reward is of the last round, and its infos are of the new episode."""
    batch = gymnasium.make_vec(RATER, num_envs=3, autoreset_mode=AutoresetMode.SAME_STEP, max_cycles=3)
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
    assert [terminations.tolist() for _, _, terminations, _, _ in steps] == [[False] * 2] * 2 + [[True] * 2]
    assert not any(truncations.any() for *_, truncations, _ in steps)


@pytest.mark.parametrize("level", ["black_box", "grey_box", "white_box"])
@EVERY_TASK
def test_a_thousand_games_stay_in_their_spaces(task_id: str, level: str) -> None:
    batch = gymnasium.make_vec(task_id, num_envs=1024, knowledge=level, stealth={"weight": 1.0}, max_cycles=5)
    observations, _ = batch.reset(seed=0)
    rows = []
    for actions in acts(batch, 7):
        assert batch.observation_space.contains(observations)
        assert observations.flags.c_contiguous
        observations, rewards, terminations, truncations, infos = batch.step(actions)
        for row in (rewards, terminations, truncations, *infos.values()):
            assert row.shape == (1024,)
        assert rewards.dtype == np.float32
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


# --- seeds, copies, Gymnasium -----------------------------------------------------------------------


@EVERY_MODE
@pytest.mark.parametrize("tensors", [False, True], ids=["numpy", "torch"])
def test_a_seed_reproduces_to_the_last_bit(mode: AutoresetMode, tensors: bool) -> None:
    arguments = ENDS | {"like": torch.zeros(())} if tensors else ENDS

    def play(batch: AttackVectorEnv, seed: int | None) -> tuple:
        steps = [batch.reset(seed=seed), *(batch.step(actions) for actions in lies(GAMES, 40, 4))]
        return tuple((*map(np.asarray, step[:-1]), np.asarray(step[-1].get("cost", 0))) for step in steps)

    batch = AttackVectorEnv(RATER, GAMES, autoreset_mode=mode, **arguments)
    first = play(batch, 3)
    again = play(batch, None)
    assert not same(first[1:], again[1:])  # goes on with the generator
    assert same(play(batch, 3), first)
    assert same(play(batch, None), again)
    assert same(play(AttackVectorEnv(RATER, GAMES, autoreset_mode=mode, **arguments), 3), first)
    assert not same(play(batch, 4)[1:], first[1:])
    assert not same(play(AttackVectorEnv(RATER, GAMES, **arguments), None)[1:], play(batch, None)[1:])


def test_a_reset_in_the_middle_forgets_who_was_to_be_restarted() -> None:
    batch, twin = (gymnasium.make_vec(RATER, num_envs=4, max_cycles=3) for _ in range(2))
    batch.reset(seed=1)
    for actions in acts(batch, 3):
        *_, truncations, _ = batch.step(actions)
    assert truncations.all()
    assert same(batch.reset(seed=2), twin.reset(seed=2))
    for actions in acts(batch, 3):
        assert same(batch.step(actions), twin.step(actions))


@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"]
)
@pytest.mark.parametrize("tensors", [False, True], ids=["numpy", "torch"])
def test_a_copy_plays_on_alike_and_apart(duplicate: Callable, tensors: bool) -> None:
    def started() -> AttackVectorEnv:
        batch = AttackVectorEnv(RATER, 4, max_cycles=4, noise=0.1, like=torch.zeros(()) if tensors else None)
        batch.reset(seed=1)
        for actions in acts(batch, 4):
            batch.step(actions)
        return batch

    def after(batch: AttackVectorEnv) -> list[np.ndarray]:  # from the step on that restarts the games
        return [np.asarray(part) for actions in acts(batch, 3, 1) for part in batch.step(actions)[:4]]

    batch, expected = started(), after(started())
    assert all(map(np.array_equal, after(duplicate(batch)), expected))
    assert all(map(np.array_equal, after(batch), expected))


def test_gymnasium_makes_it() -> None:
    batch = gymnasium.make_vec("roletrust_env:" + RATER, num_envs=5, max_cycles=9)
    assert type(batch) is AttackVectorEnv
    assert batch.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert batch.num_envs == 5
    assert batch.task.game.scenario.max_cycles == 9
    single = gymnasium.make(RATER)
    assert batch.single_action_space == single.action_space
    assert batch.single_observation_space == single.observation_space
    assert batch.action_space.shape == (5, 3)
    again = gymnasium.make_vec(batch.spec)
    assert (again.num_envs, again.task.game.scenario.max_cycles) == (5, 9)
    same_step = gymnasium.make_vec(RATER, num_envs=2, autoreset_mode=AutoresetMode.SAME_STEP)
    assert same_step.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert "autoreset_mode" not in TASKS[RATER].metadata
    batch.close()
    batch.close()


def test_wrappers_of_learners_fit() -> None:
    batch = wrappers.RecordEpisodeStatistics(gymnasium.make_vec(RATER, num_envs=3, max_cycles=4))
    batch.reset(seed=0)
    total = np.zeros(3)
    for t, actions in enumerate(acts(batch, 9)):
        _, rewards, _, truncations, infos = batch.step(actions)
        total = total + rewards if t != 4 else 0 * total
        if truncations.any():
            assert t in (3, 8)
            assert infos["episode"]["l"].tolist() == [4] * 3
            assert_close(infos["episode"]["r"], total)
    plain = gymnasium.make_vec(RATER, num_envs=3)
    scaled = wrappers.RescaleAction(gymnasium.make_vec(RATER, num_envs=3), np.float32(-1), np.float32(1))
    plain.reset(seed=0)
    scaled.reset(seed=0)
    for actions in (*acts(plain, 4), np.zeros((3, 3), np.float32), np.ones((3, 3), np.float32)):
        assert_close(scaled.step(2 * actions - 1)[0], plain.step(actions)[0])
    listed = gymnasium.make_vec(RATER, num_envs=3, max_cycles=2, autoreset_mode=AutoresetMode.SAME_STEP)
    listed = wrappers.DictInfoToList(listed)
    listed.reset(seed=0)
    assert [set(info) for info in listed.step(actions)[-1]] == [{"objective", "cost"}] * 3
    *_, infos = listed.step(actions)
    assert {"objective", "cost"} <= set(infos[2]["final_info"])
    assert infos[2]["final_obs"][0] == 1


# --- torch ------------------------------------------------------------------------------------------


@EVERY_MODE
def test_torch_plays_as_numpy_does(mode: AutoresetMode) -> None:
    batch = AttackVectorEnv(RATER, GAMES, autoreset_mode=mode, **ENDS)
    observations, _ = batch.reset(seed=5)
    tensors = AttackVectorEnv(RATER, GAMES, autoreset_mode=mode, like=torch.zeros(()), **ENDS)
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


# --- bad input --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"task_id": "RoleTrust/RaterAtack-v0"}, ["RoleTrust/RaterAtack-v0", RATER]),
        ({"num_envs": 0}, ["num_envs", "0", "1 or more"]),
        ({"num_envs": -3}, ["num_envs", "-3", "1 or more"]),
        ({"num_envs": 2.5}, ["num_envs", "2.5"]),
        ({"autoreset_mode": AutoresetMode.DISABLED}, ["autoreset_mode", "DISABLED", "NEXT_STEP", "SAME_STEP"]),
        ({"autoreset_mode": "next"}, ["autoreset_mode", "'next'", "NEXT_STEP"]),
        ({"compromised": ("sr_9",)}, ["compromised", "'sr_9'", "sr_0"]),
        ({"compromised": ("sr_1", "sr_1")}, ["compromised", "'sr_1'", "twice"]),
        ({"knowledge": "all"}, ["knowledge", "'all'", "black_box"]),
        ({"max_cycle": 3}, ["max_cycle", "max_cycles"]),
    ],
    ids=str,
)
def test_bad_arguments_are_refused(arguments: dict, words: list[str]) -> None:
    with pytest.raises(ValueError, match=words[0]) as error:
        AttackVectorEnv(**{"task_id": RATER, "num_envs": 2} | arguments)
    assert "\n" not in str(error.value)
    assert all(word in str(error.value) for word in words), str(error.value)


def test_no_games_are_refused_by_make_vec() -> None:
    with pytest.raises(ValueError, match="num_envs is 0"):
        gymnasium.make_vec(RATER, num_envs=0)


def at_the_boundary(like: Any = None) -> AttackVectorEnv:
    """Some games are to be restarted in the next step."""
    batch = AttackVectorEnv(RATER, GAMES, like=like, **ENDS)
    batch.reset(seed=4)
    for actions in lies(GAMES, 40, 4):
        *_, terminations, truncations, _ = batch.step(actions)
        if terminations.any() and not (terminations | truncations).all():
            return batch
    raise AssertionError


def spoilt(value: Any) -> np.ndarray:
    actions = np.full((GAMES, 4), 0.5)
    actions[-1, 2] = value
    return actions


@pytest.mark.parametrize(
    "actions",
    [
        pytest.param(spoilt(np.nan), id="NaN"),
        pytest.param(spoilt(np.inf), id="inf"),
        pytest.param(spoilt(1.25), id="too large"),
        pytest.param(spoilt(-0.25), id="too small"),
        pytest.param(np.zeros((4, GAMES)), id="transposed"),
        pytest.param(np.zeros((GAMES + 1, 4)), id="too many"),
        pytest.param(np.zeros(4), id="of one game"),
        pytest.param(0.5, id="a number"),
        pytest.param(None, id="None"),
        pytest.param("worst", id="a word"),
    ],
)
@pytest.mark.parametrize("tensors", [False, True], ids=["numpy", "torch"])
def test_bad_actions_are_refused_and_change_nothing(actions: Any, tensors: bool) -> None:
    like = torch.zeros(()) if tensors else None
    batch, twin = at_the_boundary(like), at_the_boundary(like)
    with pytest.raises(ValueError, match="action") as error:
        batch.step(actions)
    assert "\n" not in str(error.value)
    for good in lies(GAMES, 5, 4, 9):
        for part, value in zip(batch.step(good)[:4], twin.step(good)[:4], strict=True):
            assert np.array_equal(part, value)


@pytest.mark.parametrize("seed", [[1] * GAMES, [None] * GAMES, (1, 2)], ids=str)
def test_a_list_of_seeds_is_refused_and_changes_nothing(seed: Any) -> None:
    batch, twin = at_the_boundary(), at_the_boundary()
    with pytest.raises(ValueError, match="seed"):
        batch.reset(seed=seed)
    for good in lies(GAMES, 5, 4, 9):
        assert same(batch.step(good), twin.step(good))


def test_there_is_no_step_before_the_first_reset() -> None:
    batch = AttackVectorEnv(RATER, 2)
    with pytest.raises(RuntimeError, match=r"reset\(\)"):
        batch.step(acts(batch, 1)[0])
