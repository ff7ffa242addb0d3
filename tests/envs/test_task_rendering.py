"""What is seen of a task, through every face of it."""

import gymnasium
import numpy as np
import pytest
import torch
from refusals import refuses
from task_cases import COLLUSION, PROVIDER, RATER, acts, make, same
from vector_cases import EVERY_MODE

from roletrust_env import AttackVecEnv, make_task
from roletrust_env.envs.attack_env import TASKS


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
    assert {(frame.shape, frame.dtype) for frame in frames} == {
        ((720, 1280, 3), np.dtype(np.uint8))
    }
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


@pytest.mark.parametrize(
    "arguments", [{"render_mode": "ansi"}, {"render_mode": "rgb_array"}, {}], ids=str
)
def test_there_is_nothing_to_render(arguments: dict) -> None:
    env = make(RATER, **arguments)
    with refuses(RuntimeError, "render_mode"):
        env.render()
    if not arguments:
        env.reset(seed=0)
        with refuses(RuntimeError, "render_mode"):
            env.render()


@EVERY_MODE
@pytest.mark.parametrize("tensors", [False, True], ids=["numpy", "torch"])
def test_a_batch_shows_its_first_game(mode: gymnasium.vector.AutoresetMode, tensors: bool) -> None:
    """Over the end of episodes; the last state of one is not seen where the next begins in the same
    step."""
    batch = gymnasium.make_vec(
        RATER,
        num_envs=3,
        max_cycles=3,
        noise=0.0,
        autoreset_mode=mode,
        render_mode="ansi",
        like=torch.zeros(()) if tensors else np.zeros((), np.float32),
    )
    single = make(RATER, max_cycles=3, noise=0.0, render_mode="ansi")
    batch.reset()
    single.reset()
    assert batch.render() == (single.render(), "", "")
    over = False
    for actions in acts(batch, 9):
        batch.step(actions)
        restarts = over  # in the step after
        if not over:
            over = single.step(actions[0])[3]
            restarts = over and mode is gymnasium.vector.AutoresetMode.SAME_STEP
        if restarts:
            single.reset()
            over = False
        assert batch.render() == (single.render(), "", "")
        assert len(batch._spectator.curves) == len(single._spectator.curves)
    batch.close()


def test_a_masked_reset_of_other_games_adds_nothing_to_the_curves_of_the_first() -> None:
    batch = gymnasium.make_vec(RATER, num_envs=2, render_mode="ansi")
    batch.reset(seed=0)
    for played, restarted in enumerate((1, 1, 0), start=1):
        batch.step(batch.action_space.sample())
        assert len(batch._spectator.curves) == played + 1
        batch.reset(options={"reset_mask": np.arange(2) == restarted})
        assert len(batch._spectator.curves) == (played + 1 if restarted else 1)


@EVERY_MODE
def test_gymnasium_records_the_first_game(mode: gymnasium.vector.AutoresetMode) -> None:
    batch = gymnasium.make_vec(PROVIDER, num_envs=2, render_mode="rgb_array", autoreset_mode=mode)
    batch.reset(seed=0)
    first, other = batch.render()
    assert first.shape == other.shape == (720, 1280, 3)
    assert not other.any()
    single = make(PROVIDER, render_mode="rgb_array")
    single.reset(seed=0)
    assert np.array_equal(first, single.render())


def test_a_batch_for_stable_baselines_shows_its_first_game() -> None:
    task = make_task(**TASKS[PROVIDER].defaults, noise=0.0, max_cycles=3)
    single = make(PROVIDER, noise=0.0, max_cycles=3, render_mode="ansi")
    single.reset()
    env = AttackVecEnv(task, 4, scaled=False, render_mode="ansi")
    env.reset()
    assert env.env_method("render") == [single.render()] * 4
    for action in acts(single, 2):
        env.step(np.array([action] * 4))
        single.step(action)
        assert env.env_method("render", indices=[0]) == [single.render()]
    pictures = AttackVecEnv(task, 4, render_mode="rgb_array")
    pictures.reset()
    assert pictures.render().shape == (720, 1280, 3)
    assert len(pictures.get_images()) == 1
    pictures.close()


def test_slots_without_pictures_have_none():
    env = AttackVecEnv(make_task("paper-3x3", ("sp_2",), objective="exploit"), 3)
    env.reset()
    assert env.get_images() == [None] * 3
