"""Attacks with a memory in a batch of games: a game that begins anew forgets, and the others do
not."""

import numpy as np
import pytest

from roletrust_baselines import (
    Camouflage,
    CamouflageRating,
    CheatingRing,
    MilkingRing,
    RankLies,
    Sleeper,
)
from roletrust_env.envs.task_batch import TaskBatch
from roletrust_env.game.make_task import make_task
from roletrust_env.trees import arrays


@pytest.mark.parametrize(
    ("agent", "attack"),
    [
        ("sp_2", Camouflage(start=0, wakes_at=0.0)),
        ("sp_2", MilkingRing(accomplices=(2,))),
        ("sr_1", CamouflageRating(start=0, wakes_at=0.0)),
        ("sr_1", CheatingRing(accomplices=(2,))),
        ("sr_1", MilkingRing(accomplices=(2,))),
        ("sr_1", RankLies()),
        ("sr_1", Sleeper(start=0, wakes_at=0.0)),
    ],
    ids=repr,
)
def test_a_game_that_begins_anew_forgets_and_the_others_do_not(agent, attack):
    task = make_task("paper-3x3", ("sr_0",), others={agent: attack}, max_cycles=20)
    batch, random = TaskBatch(task, (2,)), task.game.random(0)
    batch.restart(random)
    for _ in range(5):
        batch.step(np.ones((3, 2), np.float32), random)
    old = arrays(batch.state.memories)
    assert any(leaf.any() for leaf in old)
    batch.restart(random, np.array([True, False]))
    new = arrays(batch.state.memories)
    for now, before in zip(new, old, strict=True):
        assert not now[..., 0].any()
        assert (now[..., 1] == before[..., 1]).all()
