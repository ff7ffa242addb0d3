"""The compiled engine plays the rounds of the rules, in every environment."""

import copy
import pickle
from typing import Any

import gymnasium
import numpy as np
import pytest
from refusals import refuses
from stable_baselines3.common.vec_env import SubprocVecEnv
from task_cases import PRESETS, crew

import roletrust_env as rt
from roletrust_baselines import RandomRating
from roletrust_env.envs.attack_env import TASKS
from roletrust_env.envs.sb3 import AttackVecEnv

SMALL = [preset for preset in PRESETS if preset != "crowd-100x100"]
CLOSE = {"rtol": 0, "atol": 1e-12}


def actions_of(env, random):
    return {a: random.random(env.action_space(a).shape, np.float32) for a in env.agents}


def assert_close(one: Any, other: Any) -> None:
    """Assert that nested dicts and tuples are equal, and their numbers close."""
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        one, other = tuple(one.values()), tuple(other[name] for name in one)
    if isinstance(one, tuple | list):
        for part, twin in zip(one, other, strict=True):
            assert_close(part, twin)
    elif isinstance(one, str | bool | None):
        assert one == other
    else:
        np.testing.assert_allclose(one, other, **CLOSE)


@pytest.mark.parametrize("preset", SMALL)
def test_all_agents_of_a_preset(preset):
    env, compiled = (
        rt.parallel_env(preset, engine=e, max_cycles=15) for e in ("rules", "compiled")
    )
    assert "compiled" in repr(compiled)
    for seed in (0, None):
        assert_close(env.reset(seed=seed), compiled.reset(seed=seed))
        random = np.random.default_rng(0)
        while env.agents:
            assert compiled.agents == env.agents
            actions = actions_of(env, random)
            assert_close(env.step(actions), compiled.step(actions))
            assert_close(env.state(), compiled.state())


@pytest.mark.parametrize("knowledge", ["black_box", "white_box"])
@pytest.mark.parametrize("task_id", TASKS)
def test_a_task_alone_and_in_a_batch(task_id, knowledge):
    preset = "robots-that-move"
    arguments = {
        "scenario": preset,
        "compromised": crew(task_id, preset),
        "objective": "damage" if "Rater" in task_id else "exploit",
        "stealth": {"weight": 0.5, "tolerance": 0.02},
        "others": {"sr_0": RandomRating()},
        "knowledge": knowledge,
        "max_cycles": 8,
    }
    pair = [gymnasium.make(task_id, engine=e, **arguments) for e in ("rules", "compiled")]
    assert_close(*(env.reset(seed=3) for env in pair))
    random = np.random.default_rng(0)
    for _ in range(8):
        action = random.random(pair[0].action_space.shape, np.float32)
        assert_close(*(env.step(action) for env in pair))
    for mode in ("NextStep", "SameStep"):
        pair = [
            gymnasium.make_vec(task_id, 3, engine=e, autoreset_mode=mode, **arguments)
            for e in ("rules", "compiled")
        ]
        assert_close(*(env.reset(seed=3) for env in pair))
        for _ in range(18):
            action = random.random(pair[0].action_space.shape, np.float32)
            first, second = (env.step(action) for env in pair)
            assert_close(first[:4], second[:4])
            assert_close(first[4]["objective"], second[4]["objective"])


@pytest.mark.parametrize("observation", ["coalition", "accounts"])
def test_a_coalition_for_stable_baselines(observation):
    task = rt.make_task(
        "crowd-10x10",
        ("sr_8", "sr_9", "sp_9"),
        observation=observation,
        objective="mislead",
        consumers="raters",
        max_cycles=6,
        like=np.zeros(()),
    ).with_blind_share(0.5)
    pair = [AttackVecEnv(task, 4, seed=1, engine=e) for e in ("rules", "compiled")]
    assert_close(*(env.reset() for env in pair))
    random = np.random.default_rng(0)
    for _ in range(8):
        action = 2 * random.random((4, *pair[0].action_space.shape), np.float32) - 1
        first, second = (env.step(action) for env in pair)
        assert_close(first[:3], second[:3])


def test_a_batch_in_single_precision_stays_in_it():
    like = np.zeros((), np.float32)
    env = gymnasium.make_vec("RoleTrust/RaterAttack-v0", 20, engine="compiled", like=like)
    env.reset(seed=0)
    twin = gymnasium.make_vec("RoleTrust/RaterAttack-v0", 20, like=like)
    twin.reset(seed=0)
    action = np.full((20, 3), 0.3, np.float32)
    for _ in range(5):
        first, second = env.step(action), twin.step(action)
        assert first[1].dtype == second[1].dtype == np.float32
        np.testing.assert_allclose(first[1], second[1], rtol=0, atol=1e-5)


def test_one_id_has_one_dtype():
    for engine in ("rules", "compiled"):
        one = gymnasium.make("RoleTrust/ProviderAttack-v0", engine=engine)
        many = gymnasium.make_vec("RoleTrust/ProviderAttack-v0", num_envs=1, engine=engine)
        np.testing.assert_array_equal(one.reset(seed=4)[0], many.reset(seed=4)[0][0])
        for level in (0.2, 0.9, 0.4):
            first = one.step(np.full(1, level, np.float32))
            second = many.step(np.full((1, 1), level, np.float32))
            np.testing.assert_allclose(first[0], second[0][0], **CLOSE)
            assert first[1] == pytest.approx(second[1][0], abs=1e-12)


@pytest.mark.parametrize("twin_of", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_from_the_middle_of_an_episode(twin_of):
    env = rt.parallel_env("peers", engine="compiled", max_cycles=9)
    env.reset(seed=0)
    random = np.random.default_rng(0)
    for _ in range(4):
        env.step(actions_of(env, random))
    twin = twin_of(env)
    for _ in range(3):
        actions = actions_of(env, random)
        assert_close(env.step(actions), twin.step(actions))
    task = gymnasium.make("RoleTrust/ProviderAttack-v0", engine="compiled")
    task.reset(seed=0)
    task.step(np.ones(1, np.float32))
    other = twin_of(task)
    assert_close(task.step(np.zeros(1, np.float32)), other.step(np.zeros(1, np.float32)))


def test_rendering_in_the_middle_of_an_episode():
    texts = []
    for engine in ("rules", "compiled"):
        env = rt.parallel_env("paper-3x3", render_mode="ansi", engine=engine, max_cycles=9)
        env.reset(seed=0)
        random = np.random.default_rng(0)
        for _ in range(4):
            env.step(actions_of(env, random))
        texts.append(env.render())
    assert texts[0] == texts[1]


def test_results_of_a_round_are_not_written_to_later():
    env = rt.parallel_env("paper-3x3", engine="compiled")
    env.reset(seed=0)
    random = np.random.default_rng(0)
    *_, infos = env.step(actions_of(env, random))
    observations, *_, infos = env.step(actions_of(env, random))
    kept = copy.deepcopy((observations, infos))
    env.step(actions_of(env, random))
    assert_close((observations, infos), kept)


def test_what_cannot_be_compiled_is_refused_at_construction():
    class Branching(type(rt.make_trust_model("mean"))):
        def update(self, state, ratings):
            return super().update(state, ratings) if ratings.values.sum() >= 0 else state

    with refuses(ValueError, "compiled"):
        rt.parallel_env(trust_model=Branching(), engine="compiled")
    with refuses(ValueError, "compiled"):
        rt.parallel_env("paper-3x3-hog", engine="compiled")
    with refuses(ValueError, "engine", "fast"):
        rt.parallel_env(engine="fast")

    class Level(rt.Policy):
        attacks = frozenset({"quality"})

        def __init__(self):
            self.level = 0.3

        def quality(self, view, memory, random):
            return 0 * view.trust + self.level, memory

    with refuses(ValueError, "compiled", "Level()"):
        gymnasium.make("RoleTrust/ProviderAttack-v0", engine="compiled", others={"sp_0": Level()})
    with refuses(ValueError, "engine", "fast"):
        gymnasium.make("RoleTrust/ProviderAttack-v0", engine="fast")


@pytest.mark.slow
def test_eight_workers_begin_at_once():
    def make():
        import gymnasium

        return gymnasium.make("roletrust_env:RoleTrust/CollusionAttack-v0", engine="compiled")

    env = SubprocVecEnv([make] * 8, start_method="spawn")
    assert env.reset().shape[0] == 8
    env.close()
