"""A state keeps nothing that its callers may write to again."""

import numpy as np
import pytest

from roletrust_env import Game, JointPolicy, Policy, make_scenario
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


class Scribbler(Policy):
    """A policy that writes to all it sees."""

    attacks = frozenset({"quality", "ratings"})

    def quality(self, view, memory, random):
        view.ratings[...] = view.trust[...] = view.quality[...] = 0
        return view.trust, memory

    def ratings(self, view, memory, random):
        view.service[...] = view.published[...] = 0
        return view.service, memory


def test_a_policy_that_writes_to_its_view_changes_no_state() -> None:
    game = Game(make_scenario("paper-3x3"))
    random = game.random(0)
    state = game.start(game.draw(random, start=True))
    state, _ = game.step(
        state, JointPolicy(game, {}).act(state, (None,) * 2, random)[0], game.draw(random)
    )
    before = summarise(game, state).copy()
    players = JointPolicy(game, {"sr_0": Scribbler(), "sr_2": Scribbler(), "sp_1": Scribbler()})
    players.act(state, players.begin(random), random)
    assert np.array_equal(summarise(game, state), before)
