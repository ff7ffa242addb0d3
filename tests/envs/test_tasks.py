"""The Gymnasium tasks: what checkers say, what an episode is, what is refused, and what Gymnasium makes of them."""

import copy
import pickle
import re
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.wrappers import RescaleAction

import roletrust_env
from baselines import BadMouthing, OnOff
from roletrust_env import Player, Policy, Scenario, make_scenario, parallel_env
from roletrust_env.envs.attack import AttackEnv
from roletrust_env.envs.tasks import TASKS
from roletrust_env.world.roster import Roster

PRESETS = [name for name in roletrust_env.scenarios() if "hog" not in name]
LEVELS = ("black_box", "grey_box", "white_box")
PROVIDER, RATER, DUAL, COLLUSION = TASKS


def crew(task_id: str, scenario: str) -> tuple[str, ...]:
    """Agents of a scenario that a task is about; none if it has none."""
    names = Roster.of(make_scenario(scenario)).names
    of = {role: [name for name in names if name.startswith(role + "_")] for role in ("sr", "sp", "srsp")}
    if task_id == COLLUSION:
        return tuple(name for members in of.values() for name in members[-2:])
    return tuple({PROVIDER: of["sp"], RATER: of["sr"], DUAL: of["srsp"]}[task_id][-1:])


CASES = [
    pytest.param(task_id, scenario, level, id=f"{task_id}-{scenario}-{level}")
    for task_id in TASKS
    for scenario in PRESETS
    for level in LEVELS
    if crew(task_id, scenario)
]
EVERY_TASK = pytest.mark.parametrize("task_id", TASKS)


def make(task_id: str, **arguments: Any) -> AttackEnv:
    return TASKS[task_id](**arguments)


def acts(env: gymnasium.Env, n: int, seed: int = 0) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).random((n, *env.action_space.shape), dtype=np.float32))


def same(a: tuple, b: tuple) -> bool:
    """Whether two steps or resets are the same to the last bit."""
    return data_equivalence(a, b, exact=True)


# --- what the checkers say --------------------------------------------------------------------------


@pytest.mark.parametrize(("task_id", "scenario", "level"), CASES)
@pytest.mark.filterwarnings(
    "error",
    "ignore:.*A Box observation space m..imum value is -?infinity",
    "ignore:.*Not able to test alternative render modes",
)
def test_gymnasium_finds_nothing_wrong(task_id: str, scenario: str, level: str) -> None:
    check_env(make(task_id, scenario=scenario, compromised=crew(task_id, scenario), knowledge=level))


@EVERY_TASK
@pytest.mark.filterwarnings("error", "ignore:render_mode 'human' shows nothing")
def test_gymnasium_finds_nothing_wrong_with_the_registered_ones(task_id: str) -> None:
    """With all their render modes."""
    check_env(gymnasium.make(task_id).unwrapped)


@pytest.mark.parametrize(("task_id", "scenario", "level"), CASES)
@pytest.mark.filterwarnings("error", "ignore:We recommend you to use a symmetric and normalized Box action space")
def test_stable_baselines_finds_nothing_wrong(task_id: str, scenario: str, level: str) -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(make(task_id, scenario=scenario, compromised=crew(task_id, scenario), knowledge=level))


@pytest.mark.parametrize(("task_id", "scenario", "level"), CASES)
def test_an_episode_stays_in_its_spaces(task_id: str, scenario: str, level: str) -> None:
    stealth = {"weight": 0.5, "tolerance": 0.02}
    env = make(task_id, scenario=scenario, compromised=crew(task_id, scenario), knowledge=level, stealth=stealth)
    observation, info = env.reset(seed=3)
    assert info == {"objective": 0.0, "cost": 0.0}
    for t, action in enumerate(acts(env, 30)):
        assert observation in env.observation_space
        observation, reward, terminated, truncated, info = env.step(np.round(action) if t % 3 else action)
        assert set(info) == {"objective", "cost"}
        assert 0 <= info["objective"] <= 1
        assert 0 <= info["cost"] <= 1
        assert reward == pytest.approx(info["objective"] - 0.5 * info["cost"], abs=1e-6)
        assert (type(reward), type(terminated), type(truncated)) == (float, bool, bool)
        assert not truncated
        if terminated:
            break
    assert observation in env.observation_space


@pytest.mark.parametrize(
    ("task_id", "compromised", "objective", "actions", "seen"),
    [
        (PROVIDER, ("sp_2",), "exploit", 1, 4 + 2 * 3),
        (RATER, ("sr_2",), "damage", 3, 2 + 5 * 3),
        (DUAL, ("srsp_5",), "exploit", 1 + 9, 1 + 4 + 2 * 9 + 2 + 5 * 9),
        (COLLUSION, ("sr_8", "sr_9", "sp_9"), "damage", 21, 2 * (2 + 5 * 10) + 4 + 2 * 10),
    ],
)
def test_defaults_are_as_documented(task_id: str, compromised: tuple, objective: str, actions: int, seen: int) -> None:
    env = gymnasium.make(task_id).unwrapped
    assert isinstance(env, AttackEnv)
    assert (env.task.compromised, env.task.objective, env.task.knowledge) == (compromised, objective, "black_box")
    assert env.task.stealth.weight == 0
    assert env.action_space == gymnasium.spaces.Box(0, 1, (actions,), np.float32)
    assert env.observation_space == gymnasium.spaces.Box(0, 1, (seen,), np.float32)
    roster = env.task.game.roster
    grey = make(task_id, knowledge="grey_box").observation_space
    assert grey == gymnasium.spaces.Box(0, 1, (seen + roster.n_raters + roster.n_providers,), np.float32)
    white = make(task_id, knowledge="white_box").observation_space
    assert white.shape[0] > grey.shape[0] + 4 * roster.n_raters * roster.n_providers
    assert np.all(white.low == -np.inf)
    assert np.all(white.high == np.inf)


# --- an episode -------------------------------------------------------------------------------------


def test_black_box_is_what_the_pettingzoo_agent_sees() -> None:
    """Played side by side, everybody else by hand; without luck, so that both games are one."""
    agents = [{"role": "SR", "count": 2}, {"role": "SP", "count": 2}, {"role": "SR+SP", "count": 2}]
    scenario = Scenario(agents=agents, max_cycles=12, perturbations=[{"start": 3, "stop": 5, "strength": 0.4}])
    names, others = ("srsp_0", "sp_1", "sr_0"), {"sp_0": OnOff(period=4, bad=0.3), "sr_1": BadMouthing(start=4)}
    env = make(COLLUSION, scenario=scenario, compromised=names, others=others)
    game = parallel_env(scenario)
    seen, (mine, _) = game.reset(seed=0)[0], env.reset(seed=0)
    players = {name: Player(others.get(name, Policy()), name, game.layout) for name in game.agents if name not in names}
    for action in acts(env, 12):
        assert mine == pytest.approx(np.concatenate([seen[name] for name in names]), abs=1e-6)
        deeds = {name: player(seen[name]) for name, player in players.items()}
        deeds |= {"srsp_0": action[:5], "sp_1": action[5:6], "sr_0": action[6:]}
        seen = game.step(deeds)[0]
        mine, _, terminated, truncated, _ = env.step(action)
    assert truncated
    assert not terminated


def test_the_length_truncates_and_being_caught_terminates() -> None:
    agents = [{"role": "SR", "count": 3}, {"role": "SP"}]
    world = {"scenario": Scenario(agents=agents, max_cycles=9), "compromised": ("sr_0",)}
    honest = make(RATER, **world, admission={"threshold": 0.2, "rounds": 2})
    honest.reset(seed=0)
    ends = [honest.step(np.ones(1, np.float32))[2:4] for _ in range(9)]
    assert ends == [(False, False)] * 8 + [(False, True)]
    caught = make(RATER, **world, admission={"threshold": 0.3, "rounds": 3})
    caught.reset(seed=0)
    ends = []
    while (True, False) not in ends:
        ends.append(caught.step(np.zeros(1, np.float32))[2:4])
    # A third of the raters at 0: QoR is 1 - sqrt(2/3) from the second round on, and ToR under 0.3 from the third on.
    assert ends == [(False, False)] * 4 + [(True, False)]


def test_caught_in_the_last_round_is_no_truncation() -> None:
    agents = [{"role": "SR"}, {"role": "SR", "leaves": 3}, {"role": "SP"}]
    env = make(RATER, scenario=Scenario(agents=agents, max_cycles=3), compromised=("sr_1",))
    env.reset(seed=0)
    assert [env.step(np.ones(1, np.float32))[2:4] for _ in range(3)] == [(False, False)] * 2 + [(True, False)]


@EVERY_TASK
def test_a_seed_reproduces_to_the_last_bit(task_id: str) -> None:
    others = {} if task_id != COLLUSION else {"sp_0": OnOff(switching="random")}

    def episodes(env: AttackEnv, seed: int) -> list[tuple]:
        played = [env.reset(seed=seed)]
        for _ in range(2):  # the second one goes on with the generator
            played += [env.step(action) for action in acts(env, 8)]
            played.append(env.reset())
        return played

    arguments = {"noise": 0.1, "max_cycles": 8, "knowledge": "white_box", "others": others}
    env = make(task_id, **arguments)
    first = episodes(env, 5)
    assert same(episodes(env, 5), first)
    assert same(episodes(make(task_id, **arguments), 5), first)
    assert not same(episodes(env, 6)[1:], first[1:])
    assert not same(first[1:9], first[10:18])


def test_observations_stay_as_they_were() -> None:
    env = make(COLLUSION, knowledge="white_box")
    kept = [env.reset(seed=0)[0]]
    copies = [kept[0].copy()]
    for action in acts(env, 3):
        kept.append(env.step(action)[0])
        copies.append(kept[-1].copy())
        action[:] = np.nan
    assert np.array_equal(kept, copies)


COPIES = [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))]


@pytest.mark.parametrize("duplicate", COPIES, ids=["copy", "pickle"])
@EVERY_TASK
def test_a_copy_plays_on_alike_and_apart(task_id: str, duplicate: Callable) -> None:
    def started() -> gymnasium.Env:
        env = gymnasium.make(task_id, noise=0.1, render_mode="rgb_array" if task_id == RATER else None)
        env.reset(seed=1)
        env.step(acts(env, 1)[0])
        if task_id == RATER:
            env.render()
        return env

    env, twin = started(), started()
    copied = duplicate(env)
    for action in acts(env, 3, 1):
        assert same(copied.step(action), twin.step(action))
    assert same(copied.reset(), twin.reset())
    untouched = started()
    for action in acts(env, 3, 2):
        assert same(env.step(action), untouched.step(action))


# --- Gymnasium --------------------------------------------------------------------------------------


@EVERY_TASK
def test_gymnasium_makes_it(task_id: str) -> None:
    gymnasium.register_envs(roletrust_env)
    by_module = gymnasium.make(f"roletrust_env:{task_id}", max_cycles=4)
    assert type(by_module.unwrapped) is TASKS[task_id]
    assert by_module.unwrapped.task.game.scenario.max_cycles == 4
    again = gymnasium.make(by_module.spec)
    assert again.unwrapped.task.game.scenario.max_cycles == 4
    batch = gymnasium.make_vec(f"roletrust_env:{task_id}", num_envs=3, max_cycles=4)
    assert batch.observation_space.shape == (3, *by_module.observation_space.shape)
    assert gymnasium.make(task_id, max_episode_steps=2).spec.max_episode_steps == 2


@pytest.mark.parametrize("task_id", [PROVIDER, COLLUSION])
def test_actions_can_be_rescaled(task_id: str) -> None:
    env, scaled = make(task_id), RescaleAction(make(task_id), np.float32(-1), np.float32(1))
    assert scaled.action_space == gymnasium.spaces.Box(-1, 1, env.action_space.shape, np.float32)
    env.reset(seed=2)
    scaled.reset(seed=2)
    extremes = [np.full(env.action_space.shape, x, np.float32) for x in (0, 1, 0.5)]
    for action in (*acts(env, 4), *extremes):
        a, b = env.step(action), scaled.step(2 * action - 1)
        assert b[0] == pytest.approx(a[0], abs=1e-6)
        assert b[1] == pytest.approx(a[1], abs=1e-6)
    for seed in range(20):  # nothing that the wrapper makes of its own space is refused
        scaled.action_space.seed(seed)
        scaled.step(scaled.action_space.sample())


def test_wrappers_of_learners_fit() -> None:
    env = gymnasium.wrappers.RecordEpisodeStatistics(gymnasium.make(RATER, max_cycles=5))
    env.reset(seed=0)
    rewards = [env.step(action)[1] for action in acts(env, 4)]
    *_, info = last = env.step(acts(env, 1, 1)[0])
    assert info["episode"]["l"] == 5
    assert info["episode"]["r"] == pytest.approx(sum(rewards) + last[1], abs=1e-5)


# --- rendering --------------------------------------------------------------------------------------


def test_text_shows_the_game_with_the_learner_marked() -> None:
    env, plain = make(RATER, render_mode="ansi"), make(RATER)
    other = make(RATER, render_mode="ansi", compromised=("sr_0",))
    shown = []
    for one in (env, plain, other):
        one.reset(seed=0)
    for action in acts(env, 2):
        assert same(env.step(action), plain.step(action))  # looking on changes nothing
        other.step(action)
        shown.append(env.render())
        assert env.render() == shown[-1]
    assert all(name in shown[0] for name in ("sr_0", "sr_2", "sp_1", "paper-3x3"))
    assert shown[0] != shown[1]
    lines = {line for line in shown[1].splitlines() if "attack" in line.lower() or "*" in line}
    assert any("sr_2" in line for line in lines)
    assert not any("sr_0" in line for line in lines)
    assert shown[1] != other.render()


def test_pictures_are_frames_of_one_size() -> None:
    env = make(COLLUSION, render_mode="rgb_array")
    env.reset(seed=0)
    frames = [env.render()]
    for action in acts(env, 2):
        env.step(action)
        frames.append(env.render())
    assert {(frame.shape, frame.dtype) for frame in frames} == {((720, 1280, 3), np.dtype(np.uint8))}
    assert not np.array_equal(frames[1], frames[2])
    env.close()
    env.close()
    assert np.array_equal(env.render(), frames[2])


@pytest.mark.filterwarnings("ignore:render_mode 'human' shows nothing")
def test_a_window_shows_itself() -> None:
    env = make(PROVIDER, render_mode="human")
    env.reset(seed=0)
    env.step(np.zeros(1, np.float32))
    assert env.render() is None
    env.close()


@pytest.mark.parametrize("arguments", [{"render_mode": "ansi"}, {"render_mode": "rgb_array"}, {}], ids=str)
def test_there_is_nothing_to_render(arguments: dict) -> None:
    env = make(RATER, **arguments)
    with pytest.raises(RuntimeError, match="render_mode"):
        env.render()
    if not arguments:
        env.reset(seed=0)
        with pytest.raises(RuntimeError, match="render_mode"):
            env.render()


# --- bad input --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"scenario": "paper3x3"}, ["scenario", "'paper3x3'", "paper-3x3"]),
        ({"scenario": None}, ["scenario", "None"]),
        ({"trust_model": "role-turst"}, ["trust model", "'role-turst'", "role-trust"]),
        ({"compromised": ("sr_7",)}, ["compromised", "'sr_7'", "sr_0"]),
        ({"compromised": ("sr_0", "sr_0")}, ["compromised", "'sr_0'", "twice"]),
        ({"compromised": ()}, ["compromised", "empty"]),
        ({"objective": "harm"}, ["objective", "'harm'", "damage"]),
        ({"knowledge": "all"}, ["knowledge", "'all'", "grey_box"]),
        ({"others": {"sr_9": BadMouthing()}}, ["'sr_9'", "sr_0"]),
        ({"others": {"sr_2": BadMouthing()}}, ["'sr_2'", "compromised"]),
        ({"render_mode": "hologram"}, ["render_mode", "'hologram'", "human", "rgb_array", "ansi"]),
        ({"max_cycle": 3}, ["max_cycle", "max_cycles"]),
        ({"lam": 1.0}, ["lam", "1.0", "[0.5, 1)"]),
        ({"stealth": {"weight": -1.0}}, ["weight", "-1.0"]),
        ({"stealth": {"weight": float("nan")}}, ["weight", "nan"]),
        ({"stealth": {"weight": float("inf")}}, ["weight", "inf"]),
        ({"stealth": {"weight": "much"}}, ["weight", "much"]),
        ({"stealth": {"tolerance": 2.0}}, ["tolerance", "2.0", "[0, 1]"]),
        ({"stealth": {"wieght": 2.0}}, ["wieght", "weight", "tolerance"]),
        ({"stealth": 2.0}, ["stealth", "2.0"]),
        ({"like": torch.zeros(())}, ["like"]),  # this face is NumPy's
    ],
    ids=str,
)
def test_bad_arguments_are_refused(arguments: dict, words: list[str]) -> None:
    with pytest.raises(ValueError, match=words[0]) as error:
        make(RATER, **arguments)
    assert "\n" not in str(error.value), str(error.value)
    assert all(word in str(error.value) for word in words), str(error.value)


def started(**arguments: Any) -> AttackEnv:
    env = make(RATER, noise=0.1, knowledge="white_box", **arguments)
    env.reset(seed=4)
    for action in acts(env, 2):
        env.step(action)
    return env


@pytest.mark.parametrize(
    ("action", "words"),
    [
        pytest.param([0.5, np.nan, 0.5], ["nan", "[0, 1]"], id="NaN"),
        pytest.param([0.5, np.inf, 0.5], ["inf", "[0, 1]"], id="inf"),
        pytest.param([0.5, 1.25, 0.5], ["1.25", "[0, 1]"], id="too large"),
        pytest.param([0.5, 0.5, -0.25], ["-0.25", "[0, 1]"], id="too small"),
        pytest.param(np.zeros(2), ["(2,)", "(3,)"], id="too short"),
        pytest.param(np.zeros(4), ["(4,)", "(3,)"], id="too long"),
        pytest.param(np.zeros((1, 3)), ["(1, 3)", "(3,)"], id="two axes"),
        pytest.param(0.5, ["()", "(3,)"], id="a number"),
        pytest.param(None, ["(3,)"], id="None"),
        pytest.param(["0.1", "0.2", "0.3"], ["(3,)"], id="strings"),
        pytest.param(np.zeros(3, complex), ["complex"], id="complex"),
        pytest.param([None] * 3, ["object"], id="an array of None"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_a_bad_action_is_refused_and_changes_nothing(action: Any, words: list[str]) -> None:
    env, twin = started(), started()
    with pytest.raises(ValueError, match="action") as error:
        env.step(action)
    assert "\n" not in str(error.value)
    assert all(word in str(error.value) for word in words), str(error.value)
    for good in acts(env, 3, 9):
        assert same(env.step(good), twin.step(good))


@pytest.mark.parametrize("dtype", [np.float64, np.float16, np.int64])
def test_numbers_of_any_precision_are_taken(dtype: type) -> None:
    env, twin = started(), started()
    assert same(env.step(np.ones(3, dtype)), twin.step(np.ones(3, np.float32)))
    assert same(env.step([0, 0.5, 1]), twin.step(np.array([0, 0.5, 1], np.float32)))


@EVERY_TASK
def test_there_is_no_step_before_the_first_reset(task_id: str) -> None:
    env = make(task_id)
    with pytest.raises(RuntimeError, match=re.escape("reset()")):
        env.step(acts(env, 1)[0])
    env.reset(seed=0)
    env.step(acts(env, 1)[0])


@pytest.mark.parametrize("caught", [False, True], ids=["truncated", "terminated"])
def test_there_is_no_step_after_the_end(caught: bool) -> None:
    agents = [{"role": "SR"}, {"role": "SR", "leaves": 3 if caught else None, "noise": 0.1}, {"role": "SP"}]
    scenario = Scenario(agents=agents, max_cycles=5 if caught else 3)
    env, twin = (make(RATER, scenario=scenario, compromised=("sr_1",)) for _ in range(2))
    for one in (env, twin):
        one.reset(seed=0)
        ends = [one.step(np.ones(1, np.float32))[2:4] for _ in range(3)]
        assert ends[-1] == (caught, not caught)
    for _ in range(2):
        with pytest.raises(RuntimeError, match=re.escape("reset()")):
            env.step(np.ones(1, np.float32))
    assert same(env.reset(), twin.reset())
    assert same(env.step(np.ones(1, np.float32)), twin.step(np.ones(1, np.float32)))
