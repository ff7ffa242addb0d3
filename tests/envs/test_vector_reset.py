"""The batched face: seeds, copies, and which games begin anew."""

import copy
import pickle
from collections.abc import Callable

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from refusals import refuses
from slow_vector import GAMES
from vector_cases import ENDS, EVERY_MODE, RATER, acts, assert_close, lies, same

from roletrust_env.envs.vector import AttackVectorEnv


@EVERY_MODE
@pytest.mark.parametrize("tensors", [False, True], ids=["numpy", "torch"])
def test_a_seed_reproduces_to_the_last_bit(mode: AutoresetMode, tensors: bool) -> None:
    arguments = ENDS | {"like": torch.zeros(())} if tensors else ENDS

    def play(batch: AttackVectorEnv, seed: int | None) -> tuple:
        steps = [batch.reset(seed=seed), *(batch.step(actions) for actions in lies(GAMES, 20, 4))]
        return tuple(
            (*map(np.asarray, step[:-1]), np.asarray(step[-1].get("cost", 0))) for step in steps
        )

    batch = AttackVectorEnv(RATER, GAMES, autoreset_mode=mode, **arguments)
    first = play(batch, 3)
    again = play(batch, None)
    assert not same(first[1:], again[1:])  # goes on with the generator
    assert same(play(batch, 3), first)
    assert same(play(batch, None), again)
    assert same(play(AttackVectorEnv(RATER, GAMES, autoreset_mode=mode, **arguments), 3), first)
    assert not same(play(batch, 4)[1:], first[1:])
    assert not same(
        play(AttackVectorEnv(RATER, GAMES, **arguments), None)[1:], play(batch, None)[1:]
    )


def test_a_reset_in_the_middle_forgets_who_was_to_be_restarted() -> None:
    batch, twin = (gymnasium.make_vec(RATER, num_envs=4, max_cycles=3) for _ in range(2))
    batch.reset(seed=1)
    for actions in acts(batch, 3):
        *_, truncations, _ = batch.step(actions)
    assert truncations.all()
    assert same(batch.reset(seed=2), twin.reset(seed=2))
    for actions in acts(batch, 3):
        assert same(batch.step(actions), twin.step(actions))


MASK = np.array([True, False, True])


@EVERY_MODE
@pytest.mark.parametrize(
    "steps", [2, 4, 8], ids=["in the middle", "when all have ended", "in the second episode"]
)
def test_a_masked_reset_is_what_gymnasium_does_with_single_environments(
    mode: AutoresetMode, steps: int
) -> None:
    arguments = {"max_cycles": 4, "noise": 0.0}
    batch = gymnasium.make_vec(RATER, num_envs=3, autoreset_mode=mode, **arguments)
    loop = SyncVectorEnv([lambda: gymnasium.make(RATER, **arguments)] * 3, autoreset_mode=mode)
    batch.reset()
    loop.reset()
    played = acts(batch, steps + 12)
    for actions in played[:steps]:
        batch.step(actions)
        loop.step(actions)
    options = {"reset_mask": MASK}
    (observation, infos), (expected, wanted) = (
        batch.reset(options=dict(options)),
        loop.reset(options=dict(options)),
    )
    assert_close(observation, expected)
    assert set(infos) == set(wanted)
    for name in wanted:
        assert_close(infos[name], wanted[name])
    for actions in played[steps:]:
        for actual, expected in zip(batch.step(actions)[:4], loop.step(actions)[:4], strict=True):
            assert_close(actual, expected)


@pytest.mark.parametrize("tensors", [False, True], ids=["numpy", "torch"])
def test_a_masked_reset_leaves_the_others_where_they_are(tensors: bool) -> None:
    batch = AttackVectorEnv(RATER, 3, noise=0.1, like=torch.zeros(()) if tensors else None)
    fresh = np.asarray(batch.reset(seed=1)[0])
    for actions in acts(batch, 5):
        before, *_ = batch.step(actions)
    before = np.asarray(before).copy()
    mask = torch.asarray(MASK) if tensors else MASK
    after, infos = batch.reset(seed=2, options={"reset_mask": mask})
    assert np.array_equal(after, np.where(MASK[:, None], fresh, before))
    assert set(infos) == {"objective", "cost", "_objective", "_cost"}
    assert np.array_equal(infos["_objective"], MASK)
    luck, *_ = batch.step(actions)
    batch.reset(seed=1)
    batch.reset(seed=2, options={"reset_mask": mask})
    assert np.array_equal(
        batch.step(actions)[0][0], luck[0]
    )  # of the seed, for the games that began anew


@pytest.mark.parametrize(
    "duplicate",
    [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))],
    ids=["copy", "pickle"],
)
@pytest.mark.parametrize("tensors", [False, True], ids=["numpy", "torch"])
def test_a_copy_plays_on_alike_and_apart(duplicate: Callable, tensors: bool) -> None:
    def started() -> AttackVectorEnv:
        batch = AttackVectorEnv(
            RATER, 4, max_cycles=4, noise=0.1, like=torch.zeros(()) if tensors else None
        )
        batch.reset(seed=1)
        for actions in acts(batch, 4):
            batch.step(actions)
        return batch

    def after(
        batch: AttackVectorEnv,
    ) -> list[np.ndarray]:  # from the step on that restarts the games
        return [
            np.asarray(part) for actions in acts(batch, 3, 1) for part in batch.step(actions)[:4]
        ]

    batch, expected = started(), after(started())
    assert all(map(np.array_equal, after(duplicate(batch)), expected))
    assert all(map(np.array_equal, after(batch), expected))


def test_nobody_restarts_games_by_itself_where_that_is_asked_for() -> None:
    games = gymnasium.make_vec(
        "RoleTrust/ProviderAttack-v0", 3, max_cycles=2, autoreset_mode="Disabled"
    )
    games.reset(seed=0)
    actions = np.ones((3, 1), np.float32)
    games.step(actions)
    truncated = games.step(actions)[3]
    assert truncated.all()
    with refuses(RuntimeError, "reset_mask"):
        games.step(actions)
    games.reset(options={"reset_mask": np.array([True, False, True])})
    with refuses(RuntimeError, "reset_mask"):
        games.step(actions)
    games.reset(options={"reset_mask": np.array([False, True, False])})
    assert not games.step(actions)[3].any()
