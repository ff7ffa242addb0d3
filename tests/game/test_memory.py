"""What a rater received it remembers, and what it did not deliver nobody else learns of."""

from typing import Any

import numpy as np
import pytest

from roletrust_baselines import BadMouthing
from roletrust_env import Game, JointPolicy, make_scenario, make_trust_model
from roletrust_env.game.rollout import rollout
from roletrust_env.trust.random_order import RandomOrder

LOSSES = [{"lost": 1.0}, {"late": 1.0, "delay": 1000}]


def played(model: Any, ratings: dict[str, float], policies: Any = None) -> tuple[Game, Any, Any]:
    """The game after ten rounds, the mean of the services of all but the last, and the state."""
    game = Game(make_scenario("paper-3x3").change(noise=0.2, ratings=ratings, max_cycles=10), model)
    random = game.random(seed=1)
    states = [
        played_round.state
        for played_round in rollout(JointPolicy(game, policies or {}), random, random, (4,))
    ]
    return game, np.mean([state.service for state in states[:-1]], axis=0), states[-1]


@pytest.mark.parametrize("ratings", LOSSES)
@pytest.mark.parametrize("ordered", [False, True])
def test_a_rating_that_never_arrives_is_remembered_by_its_rater(
    ratings: dict[str, float], ordered: bool
) -> None:
    model = make_trust_model("own-experience")
    game, mean, state = played(RandomOrder(model, seed=3) if ordered else model, ratings)
    assert not state.rated.any()
    np.testing.assert_allclose(game.known_trust(state), mean, rtol=0, atol=1e-12)
    game, _, state = played("mean", ratings)
    assert (game.known_trust(state) == game.scenario.initial_trust).all()


def test_a_liar_remembers_what_it_received() -> None:
    liar = {"sr_2": BadMouthing(start=0, level=0.0)}
    game, mean, state = played("own-experience", {}, liar)
    np.testing.assert_allclose(game.known_trust(state)[2], mean[2], rtol=0, atol=1e-12)
    assert (state.ratings[2] == 0).all()
