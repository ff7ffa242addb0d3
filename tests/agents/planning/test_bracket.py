"""The bracket around a rater's optimum: against the real game, against exhaustive search, and its
proof in numbers."""

import numpy as np
import pytest
from certain_worlds import certain, damage, every_sequence
from refusals import refuses

from roletrust_agents.planning.bracket import bracket_rater
from roletrust_agents.planning.exact import optimal_rater

PRICES = [(2.0, 0.1), (0.0, 0.1), (0.5, 0.05), (20.0, 0.1), (100.0, 0.0)]


def world(rounds, raters=3, providers=3, **changes):
    agents = [{"role": "SR", "count": raters}, {"role": "SP", "count": providers}]
    return certain(rounds, agents=agents, **changes)


def reached(scenario, found, liars, weight, tolerance):
    return damage(scenario, found.lies, liars, weight, tolerance, per_provider=True)


@pytest.mark.parametrize(
    ("liars", "raters", "providers", "lam", "initial_trust"),
    [(1, 3, 3, 0.5, 0.5), (2, 5, 4, 0.8, 1.0), (1, 2, 1, 0.65, 0.3), (3, 4, 2, 0.5, 0.0)],
)
def test_the_attack_scores_the_same_in_the_game(liars, raters, providers, lam, initial_trust):
    scenario = world(12, raters, providers, lam=lam, initial_trust=initial_trust)
    for weight, tolerance in PRICES:
        found = bracket_rater(
            scenario, compromised=liars, weight=weight, tolerance=tolerance, cells=12
        )
        # The game takes gaps below 1e-12 as 0; the root of one is up to 1e-6, and here 1e-8.
        assert reached(scenario, found, liars, weight, tolerance) == pytest.approx(
            found.score, abs=1e-8
        )
        assert (found.bound is None) == (liars > 1)
        assert liars > 1 or found.score <= found.bound + 1e-12


@pytest.mark.parametrize("rounds", [1, 2, 3, 4])
@pytest.mark.parametrize(("weight", "tolerance"), PRICES)
def test_no_attack_exceeds_the_bound(rounds, weight, tolerance):
    """Not one of all sequences of five notes about each of two providers."""
    scenario = world(rounds, providers=2)
    notes = (
        every_sequence(np.linspace(0, 1, 5), 2 * (rounds - 1)) if rounds > 1 else np.empty((0, 1))
    )
    lies = np.concatenate(
        [np.ones((1, 2, notes.shape[1])), notes.reshape(rounds - 1, 2, notes.shape[1])]
    )
    best = damage(scenario, lies, 1, weight, tolerance, per_provider=True).max()
    found = bracket_rater(scenario, weight=weight, tolerance=tolerance, cells=12)
    assert best <= found.bound + 1e-12


def test_the_bracket_is_narrow():
    found, single = (
        bracket_rater(certain(40), cells=24),
        optimal_rater(certain(40), cells=24),
    )
    assert found.score < found.bound < 1.006 * found.score
    assert found.score > 1.01 * single.score


def test_without_a_price_the_bracket_is_a_point():
    found = bracket_rater(certain(30), weight=0.0, cells=12)
    assert (found.lies[1:] == 0).all()
    assert found.bound == pytest.approx(found.score, abs=1e-12)


def test_the_inequality_that_the_bound_rests_on():
    x, last, s = np.linspace(0, 1, 1201)[:, None], np.linspace(0, 1, 1201), np.sinc
    counts = x * s(1 - x) * s(x - last)
    assert (counts + 2 * np.sqrt(1 - x) + s(1 - x) - s(1 - last)).min() > 1 - 1e-12
    # Its second case in the proof, in two halves.
    q, y = np.linspace(0, 0.7**0.5, 1001), np.linspace(0, 0.3, 1001)
    assert ((1 - q) * (1 + q) ** 3).min() >= 1
    assert (s(1 - y) - y - y**2 / 3).min() > -1e-15
    assert (2 * np.sqrt(1 - y) - 2 + y + 0.3 * y**2).min() > -1e-15


@pytest.mark.parametrize(
    "argument", [{"compromised": 3}, {"weight": -1.0}, {"tolerance": np.inf}, {"cells": 10}]
)
def test_arguments_out_of_range_are_refused(argument):
    with refuses(ValueError, *argument, *argument.values()):
        bracket_rater(certain(5), **argument)


def test_scenarios_with_luck_are_refused():
    with refuses(ValueError, "noise"):
        bracket_rater(certain(5).change(noise=0.01))
