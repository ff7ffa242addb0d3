"""Agents at random places."""

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_env import evaluate, make_trust_model, trust_models
from roletrust_env.testing.trust_models import play_rounds, random_rounds
from roletrust_env.trust import Ratings, Traits
from roletrust_env.trust.models.central.means import Mean
from roletrust_env.trust.random_order import RandomOrder

SHAPE = (5, 4, 2, 3)
NOBODY = np.zeros((5, 4), bool)


class FirstRaters(Mean):
    """A model that believes the first raters only, since compromised agents often are the last
    ones."""

    def update(self, state, ratings):
        mask = ratings.weights > 0
        mask[len(mask) // 2 :] = False
        return super().update(state, Ratings(ratings.values, mask))


@pytest.mark.parametrize("name", trust_models())
def test_a_model_that_treats_all_alike_gives_the_same_trust(name):
    model, rounds = make_trust_model(name), random_rounds(SHAPE)
    seated = RandomOrder(model, 3)
    plain, state = (play_rounds(one, rounds, np.zeros(SHAPE), NOBODY) for one in (model, seated))
    np.testing.assert_allclose(seated.rater_trust(state), model.rater_trust(plain), atol=1e-9)
    np.testing.assert_allclose(seated.provider_trust(state), model.provider_trust(plain), atol=1e-9)
    assert hasattr(seated, "judge_trust") == (Traits.of(model).family == "personal")
    if hasattr(seated, "judge_trust"):
        np.testing.assert_allclose(seated.judge_trust(state), model.judge_trust(plain), atol=1e-9)


@pytest.mark.parametrize("name", ["block", "first-hand", "solo-threshold"])
def test_its_choice_rule_is_that_of_the_model(name):
    """But for ties, which noise settles by the order that the model sees."""
    model, rounds = make_trust_model(name), random_rounds(SHAPE)
    seated = RandomOrder(model, 3)
    plain, state = (play_rounds(one, rounds, np.zeros(SHAPE), NOBODY) for one in (model, seated))
    noise = np.random.default_rng(0).random(SHAPE)
    np.testing.assert_allclose(
        seated.preference(state, noise), model.preference(plain, noise), atol=1e-9
    )
    assert not hasattr(RandomOrder(Mean()), "preference")


def test_an_agent_of_both_roles_is_refused():
    with refuses(ValueError, "RandomOrder"):
        evaluate(RandomOrder(Mean()), "srsp_2=on-off", "peers", games=2)


def test_the_same_round_has_the_same_result_twice():
    model, (first, second) = RandomOrder(make_trust_model("role-trust")), random_rounds(SHAPE)[:2]
    state = model.update(model.start(np.zeros(SHAPE), NOBODY), Ratings(*first))
    one, other = (model.provider_trust(model.update(state, Ratings(*second))) for _ in range(2))
    np.testing.assert_array_equal(one, other)


def test_attacks_side_by_side_meet_the_same_order_and_games_meet_others():
    state = RandomOrder(Mean(), 0).start(np.zeros((6, 6, 2, 40)), np.zeros((6, 6), bool))
    assert (state.raters[:, 0] == state.raters[:, 1]).all()
    assert (np.sort(state.raters, axis=0) == np.arange(6)[:, None, None]).all()
    assert len(np.unique(state.raters[:, 0], axis=1).T) > 20
    assert (state.raters != state.providers).any()
    other = RandomOrder(Mean(), 1).start(np.zeros((6, 6, 2, 40)), np.zeros((6, 6), bool))
    assert (state.raters != other.raters).any()


def test_it_is_the_same_on_torch():
    rounds, model = random_rounds(SHAPE), RandomOrder(make_trust_model("qor"), 5)
    state = model.start(torch.zeros(SHAPE, dtype=torch.float64), torch.tensor(NOBODY))
    for ratings, mask in rounds:
        state = model.update(state, Ratings(torch.tensor(ratings), torch.tensor(mask)))
    here = model.provider_trust(play_rounds(model, rounds, np.zeros(SHAPE), NOBODY))
    np.testing.assert_allclose(model.provider_trust(state).numpy(), here, atol=1e-12)


@pytest.mark.slow
def test_who_believes_the_first_raters_gains_nothing():
    known = evaluate(FirstRaters(), "complementary", "market", games=20, share=0.5).utility
    seated = evaluate(
        RandomOrder(FirstRaters()), "complementary", "market", games=20, share=0.5
    ).utility
    plain = evaluate("mean", "complementary", "market", games=20, share=0.5).utility
    assert known.mean > 0.98
    assert seated.mean + seated.half < known.mean - known.half
    assert seated.mean < plain.mean + plain.half + seated.half
