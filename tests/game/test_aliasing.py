"""A state keeps nothing that its callers may write to again."""

import numpy as np
import pytest

from roletrust_env import Game, make_scenario
from roletrust_env.game.state import Actions
from roletrust_env.game.summary import summarise


@pytest.mark.parametrize("scenario", ["paper-3x3", "robots-that-move"])
def test_actions_that_are_written_to_afterwards_change_no_state(scenario: str) -> None:
    game = Game(make_scenario(scenario))
    random, roster = game.random(0), game.roster
    state = game.start(game.draw(random, start=True))
    actions = Actions(np.ones(roster.n_providers), np.ones((roster.n_raters, roster.n_providers)))
    for _ in range(3):  # rounds of all kinds
        state, _ = game.step(state, actions, game.draw(random))
    before = summarise(game, state).copy()
    actions.quality[:] = actions.ratings[:] = 0
    assert np.array_equal(summarise(game, state), before)
