"""Gradients through the game: the slope against small differences, what has none, and what a run
keeps."""

import numpy as np
import pytest
import torch
from refusals import refuses
from small_market import TASK, assert_continues, run

from roletrust_agents.smooth import SmoothTask
from roletrust_agents.training.coalition_methods import GradientSearch
from roletrust_agents.training.gradients import GradientAscent
from roletrust_agents.training.settings import GradientSettings
from roletrust_env.evaluation.attackers import OpenLoop, Scripted
from roletrust_env.evaluation.measurement import SEARCHED, mean_rewards
from roletrust_env.evaluation.search import Budget, SearchMethod, UnsuitableError
from roletrust_env.game.make_task import make_task

SMALL = GradientSettings(games=4, units=4, candidates=3, validation=8, validate_every=2, wide=False)


def begun(model="beta", budget=2_000, **changes):
    return GradientAscent(
        [make_task(**TASK, trust_model=model)], SMALL.model_copy(update=changes), 0, budget
    )


@pytest.mark.parametrize("model", ["beta", "mean", "role-trust", "qor"])
def test_the_slope_is_that_of_small_differences(model):
    """In a game in which everyone rates everyone, since raters that choose a provider jump."""
    task = SmoothTask(
        make_task(**{**TASK, "scenario": "paper-3x3", "perturbations": ()}, trust_model=model), 0.1
    )
    chosen = np.random.default_rng(0).uniform(0.2, 0.8, (10, task.action_size))
    actions = torch.tensor(chosen, dtype=torch.float32, requires_grad=True)

    def score(actions):
        return mean_rewards(task, OpenLoop(actions), 0, (1, 4), SEARCHED)[0].mean()

    (slopes,) = torch.autograd.grad(score(actions), actions)
    step = 0.01 * slopes / slopes.norm()
    difference = float(score(actions.detach() + step) - score(actions.detach() - step))
    assert difference > 1e-4
    assert difference == pytest.approx(0.02 * float(slopes.norm()), rel=0.02)


def test_a_low_temperature_is_the_true_game():
    task = make_task(**TASK, trust_model="beta")
    scores = [
        mean_rewards(SmoothTask(task, t), Scripted({}), 0, (1, 50), SEARCHED)[0].mean()
        for t in (1e-6, 0.1)
    ]
    exact = mean_rewards(
        make_task(**TASK, trust_model="beta", like=torch.zeros(())),
        Scripted({}),
        0,
        (1, 50),
        SEARCHED,
    )
    assert float(scores[0]) == pytest.approx(float(exact[0].mean()), abs=1e-4)
    assert float(scores[1]) > float(scores[0]) + 0.01


@pytest.mark.slow
def test_it_learns():
    ascent = begun(budget=10_000, games=8, validation=64, validate_every=5)
    first = ascent.best.score
    run(ascent, 15)
    assert ascent.best.score > first + 0.03


def test_a_run_continues_to_the_last_bit():
    assert_continues(begun, steps=3)


def test_a_gradient_that_is_not_finite_changes_nothing(monkeypatch):
    ascent = run(begun(), 1)
    before = ascent.weights
    monkeypatch.setattr(ascent, "smooth_score", lambda vector: ((0 * vector) ** 0.5).sum())
    ascent.step()
    assert (ascent.skipped, ascent.steps) == (1, 2)
    assert np.array_equal(before, ascent.weights)
    monkeypatch.undo()
    ascent.step()
    assert not np.array_equal(before, ascent.weights)


@pytest.mark.parametrize("model", ["wary-role-trust", "role-trust"])
def test_roots_at_0_leave_the_gradient_finite(model):
    """Each rater rates one provider of three, so most distances are 0."""
    ascent = run(begun(model), 4)
    assert (ascent.skipped, ascent.steps) == (0, 4)


def test_a_network_that_is_lost_is_given_up():
    ascent = run(begun(), 4)
    best = ascent.best.weights
    with torch.no_grad():
        ascent._adam.vector.zero_()
    ascent.validate()
    assert ascent.given_up == 1
    assert np.array_equal(ascent.weights, best)


def test_what_has_no_slope_is_refused():
    with refuses(UnsuitableError, "Constant"):
        begun("constant").step()


def test_all_rounds_are_counted():
    ascent = run(begun(), 2)
    assert ascent.rounds == 10 * (
        3 * 4 + 8 + 2 * 4 + 8
    )  # start and its validation, two steps, one validation


def test_a_search_stays_in_its_budget():
    for search, least in ((GradientSearch(wide=False), 3_220), (GradientSearch(), 6_020)):
        budget = Budget(least)
        result = search.search({**TASK, "trust_model": "beta"}, budget, 0)
        assert 0.75 * least < budget.spent == result.rounds <= least
        assert isinstance(search, SearchMethod)
        with refuses(UnsuitableError, least):
            search.search({**TASK, "trust_model": "beta"}, Budget(100), 0)
