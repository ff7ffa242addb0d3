"""The tasks in Gymnasium's hands: its registry, its specs, its wrappers."""

import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import RescaleAction
from gymnasium.wrappers import vector as vector_wrappers
from refusals import refuses
from task_cases import COLLUSION, EVERY_TASK, PROVIDER, RATER, acts, make, same
from vector_cases import assert_close

import roletrust_env
from roletrust_env.envs.attack_env import TASKS
from roletrust_env.envs.vector import AttackVectorEnv

GAME = {"max_cycles": 7, "noise": 0.1, "stealth": {"weight": 1.0}, "knowledge": "grey_box"}


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


def test_gymnasium_makes_a_batch() -> None:
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


def test_wrappers_of_learners_fit_a_batch() -> None:
    batch = vector_wrappers.RecordEpisodeStatistics(
        gymnasium.make_vec(RATER, num_envs=3, max_cycles=4)
    )
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
    scaled = vector_wrappers.RescaleAction(
        gymnasium.make_vec(RATER, num_envs=3), np.float32(-1), np.float32(1)
    )
    plain.reset(seed=0)
    scaled.reset(seed=0)
    for actions in (*acts(plain, 4), np.zeros((3, 3), np.float32), np.ones((3, 3), np.float32)):
        assert_close(scaled.step(2 * actions - 1)[0], plain.step(actions)[0])
    listed = gymnasium.make_vec(
        RATER, num_envs=3, max_cycles=2, autoreset_mode=AutoresetMode.SAME_STEP
    )
    listed = vector_wrappers.DictInfoToList(listed)
    listed.reset(seed=0)
    assert [set(info) for info in listed.step(actions)[-1]] == [{"objective", "cost"}] * 3
    *_, infos = listed.step(actions)
    assert {"objective", "cost"} <= set(infos[2]["final_info"])
    assert infos[2]["final_obs"][0] == 1


# --- specs
# ------------------------------------------------------------------------------------------


@EVERY_TASK
def test_a_spec_as_json_makes_an_equal_environment(task_id: str) -> None:
    env = gymnasium.make(task_id, **GAME)
    spec = EnvSpec.from_json(env.spec.to_json())
    assert spec == env.spec
    again = gymnasium.make(spec)
    assert again.spec == env.spec
    assert type(again.unwrapped) is TASKS[task_id]
    assert same(again.reset(seed=1), env.reset(seed=1))
    for action in acts(env, 7):
        assert same(again.step(action), env.step(action))


@EVERY_TASK
@pytest.mark.parametrize(
    "changes", [{}, {"autoreset_mode": AutoresetMode.SAME_STEP, "max_episode_steps": 5}], ids=str
)
def test_a_spec_as_json_makes_an_equal_batch(task_id: str, changes: dict) -> None:
    env = gymnasium.make_vec(task_id, num_envs=3, **GAME, **changes)
    spec = EnvSpec.from_json(env.spec.to_json())
    assert spec == env.spec
    again = gymnasium.make_vec(spec)
    assert again.spec == env.spec
    assert again.unwrapped.task.compromised == TASKS[task_id].defaults["compromised"]
    assert same(again.reset(seed=1), env.reset(seed=1))
    for action in acts(env, 9):
        assert same(again.step(action), env.step(action))


def test_gymnasiums_own_batch_has_a_spec_that_makes_an_equal_one() -> None:
    env = gymnasium.make_vec(
        RATER,
        num_envs=2,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": AutoresetMode.SAME_STEP},
        trust_model=roletrust_env.make_trust_model("role-trust", lam=0.7),
    )
    again = gymnasium.make_vec(EnvSpec.from_json(env.spec.to_json()))
    assert again.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert again.envs[0].unwrapped.task.game.model == roletrust_env.make_trust_model(
        "role-trust", lam=0.7
    )


def test_a_fresh_process_needs_the_module_or_the_spec() -> None:
    """As workers of other libraries are, which have not imported `roletrust_env`."""
    spec = gymnasium.make(RATER, max_cycles=7).spec.to_json()
    code = f"""if True:
        import gymnasium
        print(gymnasium.make("roletrust_env:{RATER}", max_cycles=7).spec.max_episode_steps)
        print(gymnasium.make_vec("roletrust_env:{RATER}", num_envs=2, max_cycles=7).spec.max_episode_steps)
    """  # noqa: E501
    remake = f"""if True:
        import gymnasium
        print(gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json({spec!r})).spec.max_episode_steps)
    """
    for script, said in ((code, "7\n7\n"), (remake, "7\n")):
        assert (
            subprocess.run([sys.executable, "-c", script], capture_output=True, text=True).stdout
            == said
        )


def length(env: gymnasium.Env) -> int:
    env.reset(seed=0)
    return next(t for t, action in enumerate(acts(env, 500), 1) if env.step(action)[3])


@EVERY_TASK
def test_the_spec_tells_how_long_an_episode_is(task_id: str) -> None:
    """Also a game longer than the scenario's own, which a limit in the registry would cut off."""
    own = make(task_id).task.game.scenario.max_cycles
    for changes, rounds in (
        ({}, own),
        ({"max_cycles": own + 9}, own + 9),
        ({"max_episode_steps": 4}, 4),
    ):
        env = gymnasium.make(task_id, **changes)
        assert env.spec.max_episode_steps == rounds == length(env)
        assert gymnasium.make_vec(task_id, num_envs=2, **changes).spec.max_episode_steps == rounds
    assert (
        gymnasium.make_vec(task_id, num_envs=2, max_episode_steps=10**6).spec.max_episode_steps
        == own
    )


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_shorter_episode_is_what_gymnasium_makes_of_the_single_environment(mode: str) -> None:
    """The clock goes on as in the whole game; only the episode is shorter."""
    batch = gymnasium.make_vec(
        PROVIDER, num_envs=2, noise=0.0, max_episode_steps=3, autoreset_mode=mode
    )
    assert batch.metadata["autoreset_mode"] is AutoresetMode(mode)
    loop = SyncVectorEnv(
        [lambda: gymnasium.make(PROVIDER, noise=0.0, max_episode_steps=3)] * 2,
        autoreset_mode=AutoresetMode(mode),
    )
    assert_close(batch.reset()[0], loop.reset()[0])
    for action in acts(batch, 9):
        for actual, expected in zip(batch.step(action)[:4], loop.step(action)[:4], strict=True):
            assert_close(actual, expected)


# --- unknown arguments
# ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "face",
    [
        lambda **unknown: gymnasium.make(RATER, **unknown),
        lambda **unknown: gymnasium.make_vec(RATER, **unknown),
        lambda **unknown: make(RATER, **unknown),
        roletrust_env.parallel_env,
        roletrust_env.env,
        roletrust_env.RoleTrustParallelEnv,
    ],
    ids=["make", "make_vec", "AttackEnv", "parallel_env", "env", "RoleTrustParallelEnv"],
)
@pytest.mark.parametrize(
    ("unknown", "known"), [("frameskip", "trust_model"), ("max_cycle", "max_cycles")]
)
def test_an_unknown_argument_is_pythons_own_error(face: Any, unknown: str, known: str) -> None:
    """TorchRL passes `frameskip`, and does without it if the error says just this."""
    with refuses(TypeError, unknown, known):
        face(**{unknown: 4})
