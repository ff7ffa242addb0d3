"""The Gymnasium tasks: what checkers say, and what an episode is."""

import copy
import pickle
from collections.abc import Callable

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from task_cases import CASES, COLLUSION, DUAL, EVERY_TASK, PROVIDER, RATER, acts, crew, make, same

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Player, Policy, Scenario, parallel_env
from roletrust_env.envs.attack_env import AttackEnv

# --- what the checkers say
# --------------------------------------------------------------------------


@pytest.mark.parametrize(("task_id", "scenario", "level"), CASES)
@pytest.mark.filterwarnings(
    "error",
    "ignore:.*A Box observation space m..imum value is -?infinity",
    "ignore:.*Not able to test alternative render modes",
)
def test_gymnasium_finds_nothing_wrong(task_id: str, scenario: str, level: str) -> None:
    check_env(
        make(task_id, scenario=scenario, compromised=crew(task_id, scenario), knowledge=level)
    )


@EVERY_TASK
@pytest.mark.filterwarnings("error", "ignore:render_mode 'human' shows nothing")
def test_gymnasium_finds_nothing_wrong_with_the_registered_ones(task_id: str) -> None:
    """With all their render modes."""
    check_env(gymnasium.make(task_id).unwrapped)


@pytest.mark.parametrize(("task_id", "scenario", "level"), CASES)
@pytest.mark.filterwarnings(
    "error", "ignore:We recommend you to use a symmetric and normalized Box action space"
)
def test_stable_baselines_finds_nothing_wrong(task_id: str, scenario: str, level: str) -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(
        make(task_id, scenario=scenario, compromised=crew(task_id, scenario), knowledge=level)
    )


@pytest.mark.parametrize(("task_id", "scenario", "level"), CASES)
def test_an_episode_stays_in_its_spaces(task_id: str, scenario: str, level: str) -> None:
    stealth = {"weight": 0.5, "tolerance": 0.02}
    env = make(
        task_id,
        scenario=scenario,
        compromised=crew(task_id, scenario),
        knowledge=level,
        stealth=stealth,
    )
    observation, info = env.reset(seed=3)
    assert info == {"objective": 0.0, "cost": 0.0}
    for t, action in enumerate(acts(env, 30)):
        assert observation in env.observation_space
        observation, reward, terminated, truncated, info = env.step(
            np.round(action) if t % 3 else action
        )
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
def test_defaults_are_as_documented(
    task_id: str, compromised: tuple, objective: str, actions: int, seen: int
) -> None:
    env = gymnasium.make(task_id).unwrapped
    assert isinstance(env, AttackEnv)
    assert (env.task.compromised, env.task.objective, env.task.knowledge) == (
        compromised,
        objective,
        "black_box",
    )
    assert env.task.stealth.weight == 0
    assert env.action_space == gymnasium.spaces.Box(0, 1, (actions,), np.float32)
    assert env.observation_space == gymnasium.spaces.Box(0, 1, (seen,), np.float32)
    roster = env.task.game.roster
    grey = make(task_id, knowledge="grey_box").observation_space
    assert grey == gymnasium.spaces.Box(
        0, 1, (seen + roster.n_raters + roster.n_providers,), np.float32
    )
    white = make(task_id, knowledge="white_box").observation_space
    assert white.shape[0] > grey.shape[0] + 4 * roster.n_raters * roster.n_providers
    assert np.all(white.low == -np.inf)
    assert np.all(white.high == np.inf)


# --- an episode
# -------------------------------------------------------------------------------------


def test_black_box_is_what_the_pettingzoo_agent_sees() -> None:
    """Played side by side, everybody else by hand; without luck, so that both games are one."""
    agents = [{"role": "SR", "count": 2}, {"role": "SP", "count": 2}, {"role": "SR+SP", "count": 2}]
    scenario = Scenario(
        agents=agents, max_cycles=12, perturbations=[{"start": 3, "stop": 5, "strength": 0.4}]
    )
    names, others = (
        ("srsp_0", "sp_1", "sr_0"),
        {"sp_0": OnOff(period=4, bad=0.3), "sr_1": BadMouthing(start=4)},
    )
    env = make(COLLUSION, scenario=scenario, compromised=names, others=others)
    game = parallel_env(scenario)
    seen, (mine, _) = game.reset(seed=0)[0], env.reset(seed=0)
    players = {
        name: Player(others.get(name, Policy()), name, game.layout)
        for name in game.agents
        if name not in names
    }
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
    # A third of the raters at 0: QoR is 1 - sqrt(2/3) from the second round on, and ToR under 0.3
    # from the third on.
    assert ends == [(False, False)] * 4 + [(True, False)]


def test_caught_in_the_last_round_is_no_truncation() -> None:
    agents = [{"role": "SR"}, {"role": "SR", "leaves": 3}, {"role": "SP"}]
    env = make(RATER, scenario=Scenario(agents=agents, max_cycles=3), compromised=("sr_1",))
    env.reset(seed=0)
    assert [env.step(np.ones(1, np.float32))[2:4] for _ in range(3)] == [(False, False)] * 2 + [
        (True, False)
    ]


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
        env = gymnasium.make(
            task_id, noise=0.1, render_mode="rgb_array" if task_id == RATER else None
        )
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
