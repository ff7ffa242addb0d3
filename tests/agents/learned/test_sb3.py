"""A model of Stable-Baselines3 at play, by one call: as a policy, and as an attacker of several
agents."""

import numpy as np
import pytest
from refusals import refuses

pytest.importorskip("stable_baselines3")

from sb3_contrib import RecurrentPPO
from stable_baselines3 import A2C, PPO, SAC
from stable_baselines3.common.vec_env import VecNormalize

from roletrust_agents.learned import attacker_of, policy_of
from roletrust_env import (
    AttackVecEnv,
    Game,
    JointPolicy,
    Player,
    Policy,
    make_task,
    parallel_env,
    record,
)
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import HELD_OUT, mean_rewards

SHORT = {"max_cycles": 25, "noise": 0.0}
BATCH = {"n_steps": 25, "batch_size": 100, "n_epochs": 2}


def one(agent="sp_2", **changes):
    return make_task("paper-3x3", (agent,), **{**SHORT, **changes})


def trained(task, kind=PPO, policy="MlpPolicy", *, scaled=True, wrap=lambda env: env, **settings):
    env = wrap(AttackVecEnv(task, 8, scaled=scaled, seed=0))
    return kind(policy, env, seed=0, device="cpu", **(settings or BATCH)).learn(200)


def reward_in_training_env(model, task, games=3):
    """The mean reward per round that SB3's own loop finds."""
    env = AttackVecEnv(task, games, scaled=model.action_space.low.min() < 0, seed=5)
    normalising = model.get_vec_normalize_env()
    seen, state, total, first = env.reset(), None, np.zeros(games), np.ones(games, bool)
    for _ in range(task.game.scenario.max_cycles):
        seen = seen if normalising is None else normalising.normalize_obs(seen)
        actions, state = model.predict(seen, state=state, episode_start=first, deterministic=True)
        seen, rewards, first, _ = env.step(actions)
        total += rewards
    return total / task.game.scenario.max_cycles


KINDS = pytest.mark.parametrize(
    ("kind", "options", "agent"),
    [
        (PPO, {}, "sp_2"),
        (PPO, {"scaled": False}, "sr_1"),
        (PPO, {"wrap": lambda env: VecNormalize(env)}, "sr_1"),
        (A2C, {"n_steps": 5}, "sp_2"),
        (SAC, {"learning_starts": 50, "buffer_size": 500}, "sr_1"),
        (RecurrentPPO, {"policy": "MlpLstmPolicy", **BATCH}, "sp_2"),
    ],
    ids=["ppo", "unscaled", "normalised", "a2c", "sac", "recurrent"],
)


@KINDS
def test_policy_and_attacker_play_as_the_model_does_in_its_environment(kind, options, agent):
    task = one(agent)
    model = trained(task, kind, **options)
    expected = reward_in_training_env(model, task)[0]  # no noise: all games are alike
    by_policy = mean_rewards(task, Scripted({agent: policy_of(model, task)}), 0, (1, 2), HELD_OUT)[
        0
    ]
    as_one = mean_rewards(task, attacker_of(model, task), 0, (1, 2), HELD_OUT)[0]
    assert by_policy == pytest.approx(np.full((1, 2), expected), abs=1e-5)
    assert as_one == pytest.approx(by_policy, abs=1e-6)


def test_the_policy_plays_in_a_joint_policy_on_torch_and_in_pettingzoo():
    torch = pytest.importorskip("torch")
    task = one("sr_2")
    model = trained(task, RecurrentPPO, "MlpLstmPolicy", **BATCH)
    policy = policy_of(model, task)
    exact = Game(task.game.scenario, "role-trust")
    histories = [
        record(JointPolicy(game, {"sr_2": policy}), game.random(0), (2,))
        for game in (
            exact,
            Game(task.game.scenario, "role-trust", torch.zeros((), dtype=torch.float64)),
        )
    ]
    assert np.asarray(histories[1].top) == pytest.approx(histories[0].top, abs=1e-5)
    env = parallel_env(task.game.scenario)
    players = {
        name: Player(policy if name == "sr_2" else Policy(), name, env.layout)
        for name in env.possible_agents
    }
    seen, _ = env.reset(seed=0)
    for top in histories[0].top[:, :, 0]:
        seen, *_, infos = env.step({name: players[name](seen[name]) for name in env.agents})
        assert [infos[f"sp_{j}"]["trust"] for j in range(3)] == pytest.approx(top, abs=1e-5)
    assert repr(policy).startswith("LearnedRater(RecurrentPPO after 200 steps, sr_2 in paper-3x3")


@pytest.mark.parametrize("knowledge", ["black_box", "grey_box", "white_box"])
def test_several_agents_are_one_attacker(knowledge):
    task = make_task("crowd-10x10", ("sr_8", "sr_9", "sp_9"), knowledge=knowledge, **SHORT)
    model = trained(task)
    found = mean_rewards(task, attacker_of(model, task), 0, (1, 2), HELD_OUT)[0]
    assert found == pytest.approx(np.full((1, 2), reward_in_training_env(model, task)[0]), abs=1e-5)


def test_what_is_no_policy_of_one_agent_is_refused():
    task = make_task("crowd-10x10", ("sr_8", "sp_9"), **SHORT)
    with refuses(ValueError, "sr_8", "sp_9", "attacker_of"):
        policy_of(None, task)
    for function in (policy_of, attacker_of):
        with refuses(ValueError, "task", 4):
            function(3, 4)
    with refuses(ValueError, "sp_2", "grey_box", "attacker_of"):
        policy_of(None, one(knowledge="grey_box"))


def test_what_is_no_model_of_the_task_is_refused():
    model = trained(one("sp_2"))
    with refuses(ValueError, "None", "Stable-Baselines3"):
        policy_of(None, one())
    with refuses(ValueError, "Box(0.0, 1.0, (10,), float32)", "Box(0.0, 1.0, (17,), float32)"):
        attacker_of(model, one("sr_2"))


def test_a_game_of_another_size_is_refused_in_one_line():
    task = one("sp_2")
    policy = policy_of(trained(task), task)
    larger = make_task("crowd-10x10", ("sp_2",), **SHORT).game
    with refuses(ValueError, "LearnedProvider", "3"):
        record(JointPolicy(larger, {"sp_2": policy}), larger.random(0))
