"""Learners that climb where there is a slope and stay where there is none, and best responses that
are known."""

import numpy as np
import pytest

from roletrust_agents.strategic.learning import (
    LearningSettings,
    best_response,
    best_welfare,
    learn,
    mean_rewards,
    play,
)
from roletrust_agents.strategic.strategies import (
    BOUNDS,
    departure,
    honest_population,
    random_population,
    uniform_population,
)
from roletrust_env import Game, make_scenario


def game(model, cost=0.1, rounds=10):
    scenario = make_scenario("crowd-10x10").change(
        agents=[{"role": "SR", "count": 4, "noise": 0.05}, {"role": "SP", "count": 3}],
        max_cycles=rounds,
        rewards={"quality_cost": cost},
    )
    return Game(scenario, model)


QUICK = LearningSettings(steps=40, pairs=8)


def test_where_trust_ignores_ratings_providers_learn_to_save_the_cost_and_raters_stay():
    played = game("constant")
    start = honest_population(played, (2,))
    learned = learn(played, start, QUICK, seed=0)
    assert departure("providers", learned.population.providers).min() > 0.6
    np.testing.assert_array_equal(learned.population.raters, start.raters)
    assert learned.course.shape == (40, 2, 2)
    assert np.all(learned.course[:, 1] == 0)
    assert np.all(np.diff(learned.course[[0, 20, 39], 0], axis=0) > 0)


def test_where_trust_follows_cheap_quality_providers_learn_to_serve():
    played = game("mean", cost=0.0)
    learned = learn(played, uniform_population(played, (0.3, 0.0), (0.0, 0.0), (2,)), QUICK, seed=0)
    assert learned.population.providers[0].min() > 0.6


def test_from_shuffled_rewards_nothing_is_learnt():
    """Under a constant trust honest providers learn to save the cost, but not if they do not know
    what saved it."""
    played = game("constant")
    start = honest_population(played, (4,))
    found = [
        learn(played, start, QUICK, seed=0, shuffled=shuffled).population.providers
        for shuffled in (False, True)
    ]
    learned, drifted = (departure("providers", one).mean() for one in found)
    assert learned > 2 * drifted


def test_the_same_seed_learns_the_same_and_another_one_does_not():
    played, settings = game("role-trust"), LearningSettings(steps=3, pairs=4)
    start = random_population(played, (2,), seed=5)
    one, two, other = (learn(played, start, settings, seed).population for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.raters, two.raters)
    assert np.any(one.raters != other.raters)


def test_parameters_stay_in_their_ranges_and_each_step_is_counted():
    played, steps = game("role-trust"), []
    learned = learn(
        played,
        random_population(played, (2,), 0),
        LearningSettings(5, 4, 0.5, 0.9),
        0,
        advance=lambda: steps.append(1),
    )
    assert len(steps) == 5
    for side, bounds in BOUNDS.items():
        for row, (low, high) in zip(getattr(learned.population, side), bounds, strict=True):
            assert low <= row.min() <= row.max() <= high


def test_the_best_response_where_trust_is_constant_is_no_service():
    played = game("constant", cost=0.4)
    found = best_response(played, honest_population(played, (3,)), "providers", 0, 2)
    np.testing.assert_allclose(found.gain, 0.4)
    assert departure("providers", found.parameters[:, None]).min() > 0.5


@pytest.mark.parametrize("side", ["providers", "raters"])
def test_nothing_is_gained_where_ratings_are_free_of_reward_or_service_of_cost(side):
    played = game("mean", cost=0.0)
    found = best_response(played, honest_population(played, (3,)), side, 0, 2)
    np.testing.assert_array_equal(found.gain, 0)
    np.testing.assert_array_equal(
        found.parameters.T, [(1, 0) if side == "providers" else (0, 0)] * 3
    )


def test_a_best_response_is_that_of_a_loop_over_the_grid():
    """The gain is what `mean_rewards` says of the deviation alone, in the games that did not choose
    it."""
    from roletrust_agents.strategic.learning import DEVIATED, mean_rewards

    played = game("leave-one-out")
    others = uniform_population(played, (0.5, 0.0), (0.4, 0.0), (1,))
    found = best_response(played, others, "raters", 4, 6)
    changed = others._replace(raters=others.raters.copy())
    changed.raters[:, 0, 0] = found.parameters[:, 0]
    one, other = (
        mean_rewards(
            played,
            type(p)(*(np.repeat(x[:, :, None, :, None], 2, axis=2) for x in p)),
            (DEVIATED, 4),
            (1, 12),
            rows=2,
        )
        for p in (changed, others)
    )
    assert found.gain[0] > 0.001
    assert found.gain[0] == pytest.approx((one[0, 0] - other[0, 0])[0, 6:].mean(), abs=1e-12)


def test_the_best_welfare_is_honest_where_trust_is_informed():
    played = game("mean", cost=0.25)
    np.testing.assert_allclose(best_welfare(played, 0, 3, 4), 0.75, atol=1e-9)


def test_rounds_have_the_weights_of_the_scenario():
    """A game that hardly ever goes on is one of a single round."""
    found = []
    for changes in ({"continuation": 1e-9}, {"max_cycles": 1}):
        played = Game(game("mean").scenario.change(**changes), "mean")
        population = uniform_population(played, np.full((2, 1), 0.5), np.full((2, 1), 0.5), (1, 1))
        asked = played, population, (0,), (1, 3), 1
        found.append((mean_rewards(*asked), *play(*asked)))
    for first, only in zip(*found, strict=True):
        np.testing.assert_allclose(first, only, rtol=1e-6, atol=1e-8)
