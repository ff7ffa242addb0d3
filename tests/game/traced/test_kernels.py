"""Kernels in C play batches as NumPy does, to the rounding of their precision."""

from functools import partial

import numpy as np
import pytest

from roletrust_env import Game, Scenario, make_scenario, make_task, trust_models
from roletrust_env.envs.sb3 import AttackVecEnv
from roletrust_env.envs.vector import AttackVectorEnv
from roletrust_env.game.state import Actions
from roletrust_env.game.traced import compiler, kernels
from roletrust_env.game.traced.kernels import Kernel
from roletrust_env.trees import arrays

pytestmark = pytest.mark.skipif(compiler.compiler() is None, reason="there is no C compiler")

NO_KERNEL = {
    "beta-filtered",
    "eigentrust",
    "iterative-filtering",
    "merit-rank",
    "personalized-pagerank",
    "power-trust",
    "travos",
}


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setattr(compiler, "_folder", lambda: tmp_path)


def play(game, state, actions, key):
    """Play a round with all that a learner needs."""
    state, rewards = game.step(state, actions, game.noise(key, state.round.shape))
    return state, rewards, game.observations(state)


def worst_difference(game, games, rounds, threads=1, begin=0):
    """Return the largest difference of a kernel to NumPy in any number of any round from that of
    the beginning on."""
    numpy, random = partial(play, game), game.random(1)
    kernel = Kernel(numpy, threads)
    state = other = game.start(game.draw(random, (games,), start=True))
    worst = 0.0
    for t in range(rounds):
        actions = Actions(random.uniform(state.quality.shape), random.uniform(state.ratings.shape))
        key = random.round_key()
        expected = numpy(state, actions, key)
        found = kernel(other, actions, key) if t >= begin else expected
        state, other = expected[0], found[0]
        for one, two in zip(arrays(expected), arrays(found), strict=True):
            assert (one.shape, one.dtype) == (two.shape, two.dtype)
            same = (one == two) | (np.isnan(one) & np.isnan(two))
            with np.errstate(invalid="ignore"):
                worst = max(
                    worst, np.where(same, 0.0, np.abs(one.astype(float) - two)).max(initial=0.0)
                )
    return worst


def test_a_kernel_plays_as_numpy_does_in_either_precision(monkeypatch):
    monkeypatch.setattr(
        kernels, "_SLICE", 128
    )  # so that a small batch has slices, of which the last is short
    for dtype, rounding in ((np.float32, 1e-5), (np.float64, 1e-12)):
        game = Game(make_scenario("paper-3x3"), "mean", like=np.zeros((), dtype))
        assert worst_difference(game, 300, 40, threads=2) < rounding, dtype


@pytest.mark.slow
def test_all_models_have_a_kernel_or_a_reason():
    """The first two rounds have forms of their own, and to compile them takes most of the time: in
    one precision."""
    for name in trust_models():
        for dtype, rounding, begin in ((np.float32, 3e-5, 0), (np.float64, 1e-12, 2)):
            game = Game(make_scenario("paper-3x3"), name, like=np.zeros((), dtype))
            if name not in NO_KERNEL:
                assert worst_difference(game, 40, 60, begin=begin) < rounding, (name, dtype)
                continue
            with pytest.raises(ValueError, match="there is no kernel for these games: "):
                worst_difference(game, 40, 1)


@pytest.mark.slow
def test_masks_schedules_and_movement_have_kernels():
    ways: list[dict] = [
        {"agents": [{"role": "SR+SP", "count": 2}], "ratings": {"lost": 0.2, "late": 0.3}},
        {
            "agents": [
                {"role": "SR+SP", "count": 1, "turns": ["SR", "SP"]},
                {"role": "SR+SP", "count": 2},
            ]
        },
        {
            "agents": [{"role": "SR+SP", "count": 2}],
            "access": {"kind": "in-range"},
            "values": [0.5, 1.0],
        },
    ]
    for way in ways:
        game = Game(Scenario(**way, max_cycles=60), like=np.zeros((), np.float64))
        assert worst_difference(game, 40, 60) < 1e-12, way


def test_the_games_of_a_vector_environment_end_and_begin_as_on_numpy():
    make = partial(
        AttackVectorEnv, "RoleTrust/ProviderAttack-v0", 5, trust_model="mean", max_episode_steps=4
    )
    envs = make(autoreset_mode="SameStep"), make(autoreset_mode="SameStep", threads=2)
    for env in envs:
        env.reset(seed=1)
    random, mask = np.random.default_rng(0), np.array([True, False, True, False, False])
    for k in range(10):
        if k == 5:  # so that games are in different rounds
            for env in envs:
                env.reset(options={"reset_mask": mask.copy()})
        action = random.random(envs[0].action_space.shape, np.float32)
        expected, found = (env.step(action) for env in envs)
        for one, two in zip(
            (*expected[:4], *expected[4].values()), (*found[:4], *found[4].values()), strict=True
        ):
            if not isinstance(one, dict):
                np.testing.assert_allclose(one, two, atol=1e-5)
        assert expected[4].keys() == found[4].keys()


def test_stable_baselines_plays_kernels():
    task = partial(
        make_task, "paper-3x3", ("sp_2",), trust_model="mean", like=np.zeros((), np.float32)
    )
    envs = [AttackVecEnv(task(), 5, seed=1, threads=threads) for threads in (0, 1)]
    actions = np.random.default_rng(0).uniform(
        -1, 1, (4, *envs[0].reset().shape[:1], *envs[0].action_space.shape)
    )
    envs[1].reset()
    for action in actions.astype(np.float32):
        expected, found = (env.step(action) for env in envs)
        np.testing.assert_allclose(expected[0], found[0], atol=1e-5)
        np.testing.assert_allclose(expected[1], found[1], atol=1e-5)
        assert expected[3][0].keys() == found[3][0].keys()


def test_refusals_say_why(monkeypatch):
    with pytest.raises(
        ValueError, match=r"no kernel for these games: .* calls NumPy: C has no solve"
    ):
        AttackVectorEnv("RoleTrust/ProviderAttack-v0", 2, trust_model="eigentrust", threads=1)
    with pytest.raises(ValueError, match="threads is -1"):
        AttackVectorEnv("RoleTrust/ProviderAttack-v0", 2, threads=-1)
    with pytest.raises(ValueError, match=r"last axis must be that of the 3 games"):
        Kernel(lambda state, more: (state + more,))(np.zeros((2, 3)), np.zeros((2, 4)))
    monkeypatch.setattr(kernels, "compiler", lambda: None)
    with pytest.raises(ValueError, match="needs a C compiler"):
        Kernel(lambda state: (state,))
