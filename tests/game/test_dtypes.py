"""Games are played in floats of 32 or 64 bits."""

from typing import Any

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_env import Actions, Game, make_scenario
from roletrust_env.arrays import namespace


@pytest.mark.parametrize(
    "like", [np.zeros((), np.float16), np.zeros((), int), torch.zeros((), dtype=torch.bfloat16)]
)
def test_other_dtypes_are_refused(like: object) -> None:
    with refuses(ValueError, "float32", "float64"):
        Game(make_scenario("paper-3x3"), like=like)


@pytest.mark.parametrize(
    "like", [np.zeros((), np.float32), torch.zeros(())], ids=["numpy", "torch"]
)
def test_actions_in_another_precision_do_not_change_that_of_the_game(like: Any) -> None:
    game = Game(make_scenario("paper-3x3"), like=like)
    random, xp = game.random(0), namespace(like)
    state = game.start(game.draw(random, start=True))
    for _ in range(3):
        actions = Actions(xp.ones(3, dtype=xp.float64), xp.ones((3, 3), dtype=xp.float64))
        state, rewards = game.step(state, actions, game.draw(random))
    assert {
        *(trust.dtype for trust in game.published(state)),
        state.quality.dtype,
        rewards.dtype,
    } == {like.dtype}
