"""Exact optima against the real game, against exhaustive search, and against their own grids."""

from functools import partial

import numpy as np
import pytest
from certain_worlds import certain, damage, every_sequence, exploit
from refusals import refuses

from roletrust_agents.planning import exact, grid
from roletrust_agents.planning.exact import Damage, Exploit, optimal_provider, optimal_rater
from roletrust_env import make_scenario

QUICK = {"cells": 48}


@pytest.fixture(scope="module")
def provider():
    return optimal_provider(certain(200), cells=100)


@pytest.fixture(scope="module")
def rater():
    return optimal_rater(certain(200), **QUICK)


# --- played in the real game
# -------------------------------------------------------------------------


@pytest.mark.slow
def test_provider_scores_the_same_in_the_game(provider):
    assert exploit(certain(200), provider.actions) == pytest.approx(provider.score, abs=1e-12)


@pytest.mark.slow
def test_rater_scores_the_same_in_the_game(rater):
    assert damage(certain(200), rater.actions, 1, 2.0, 0.1) == pytest.approx(rater.score, abs=1e-12)


@pytest.mark.parametrize(
    ("liars", "raters", "weight", "tolerance"),
    [(1, 3, 0.5, 0.0), (2, 5, 3.0, 0.05), (3, 4, 2, 0.1)],
)
@pytest.mark.parametrize(("lam", "initial_trust"), [(0.5, 0.0), (0.8, 1.0), (0.65, 0.3)])
def test_other_worlds_score_the_same_in_the_game(
    liars, raters, weight, tolerance, lam, initial_trust
):
    agents = [{"role": "SR", "count": raters}, {"role": "SP", "count": 2}]
    world = certain(15, agents=agents, lam=lam, initial_trust=initial_trust)
    best = optimal_provider(world, cells=12)
    assert exploit(world, best.actions) == pytest.approx(best.score, abs=1e-12)
    best = optimal_rater(world, compromised=liars, weight=weight, tolerance=tolerance, cells=12)
    assert damage(world, best.actions, liars, weight, tolerance) == pytest.approx(
        best.score, abs=1e-12
    )


# --- against all there is
# ----------------------------------------------------------------------------


@pytest.mark.parametrize("rounds", [1, 2, 3, 4])
@pytest.mark.parametrize("initial_trust", [0.5, 0.9])
def test_provider_equals_exhaustive_search(rounds, initial_trust):
    world, task = certain(rounds, initial_trust=initial_trust), Exploit(0.5, initial_trust, rounds)
    best = exploit(world, every_sequence(np.linspace(0, 1, 11), rounds)).max()
    table = grid.backward(task, 10, 1000)
    found = exploit(world, grid.forward(task, table, finer=1))
    assert found == pytest.approx(best, abs=1e-12)
    assert grid.start_value(task, table) / rounds == pytest.approx(best, abs=1e-6)
    assert optimal_provider(world, **QUICK).score >= best - 1e-12


@pytest.mark.parametrize("rounds", [1, 2, 3, 4, 5])
@pytest.mark.parametrize(("weight", "tolerance"), [(2.0, 0.1), (2.0, 0.0), (0.0, 0.1), (0.7, 0.05)])
def test_rater_equals_exhaustive_search(rounds, weight, tolerance):
    world, task = certain(rounds), Damage(0.5, 0.5, rounds, 1 / 3, weight, tolerance)
    lies = (
        1 - every_sequence(np.linspace(0, 1, 9), rounds - 1) ** 2
        if rounds > 1
        else np.empty((0, 1))
    )
    best = damage(
        world, np.concatenate([np.ones((1, lies.shape[1])), lies]), 1, weight, tolerance
    ).max()
    table = grid.backward(task, 8, 1000)
    found = damage(
        world, np.append(1.0, 1 - grid.forward(task, table, finer=1) ** 2), 1, weight, tolerance
    )
    assert found == pytest.approx(best, abs=1e-12)
    assert grid.start_value(task, table) / rounds == pytest.approx(best, abs=1e-4)
    assert optimal_rater(world, weight=weight, tolerance=tolerance, **QUICK).score >= best - 1e-12


# --- what is found
# -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_provider_beats_all_constant_and_regular_scripts(provider):
    """By 32% the best constant, by 9% the best on-off of equal spells, and by 5.9% the best of any
    duty (2 of 5)."""
    rounds = np.arange(200)[:, None]
    constant = np.linspace(0, 1, 101) + 0 * rounds
    equal = np.concatenate([(rounds % (2 * bad) >= bad) * 1.0 for bad in range(1, 7)], axis=1)
    spells = [(period, bad) for period in range(2, 13) for bad in range(1, period)]
    on_off = np.concatenate([(rounds % period >= bad) * 1.0 for period, bad in spells], axis=1)
    margins = [
        provider.score / exploit(certain(200), script).max() for script in (constant, equal, on_off)
    ]
    assert margins == pytest.approx([1.3246, 1.0905, 1.0588], abs=1e-3)
    assert provider.score == pytest.approx(0.243523, abs=1e-6)


@pytest.mark.slow
def test_provider_plays_a_cycle_of_five(provider):
    middle = provider.actions[50:150].reshape(-1, 5)
    assert middle == pytest.approx(np.broadcast_to(middle[0], middle.shape), abs=1e-3)
    assert np.sort(middle[0]) == pytest.approx([0, 0, 0.738, 0.970, 1], abs=2e-3)


@pytest.mark.slow
def test_rater_with_stealth_alternates(rater):
    assert np.sort(rater.actions[100:102]) == pytest.approx([0, 0.984], abs=2e-3)
    assert rater.actions[100:150:2] == pytest.approx(np.full(25, rater.actions[100]), abs=1e-3)
    assert rater.score == pytest.approx(0.48059, abs=2e-5)


@pytest.mark.slow
def test_lies_that_differ_between_providers_do_more(rater):
    """What the docstring of `optimal_rater` says of its own limit."""
    pattern = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[np.arange(200) % 2]
    pattern[1] = 0
    score = damage(certain(200), pattern, 1, 2.0, 0.1, per_provider=True)
    assert score == pytest.approx(0.48823, abs=1e-5)
    assert score > 1.015 * rater.score


def test_rater_without_stealth_rates_zero():
    """Rating 0 makes every QoP as low as it can be: it is the optimum by proof, so the error must
    be none."""
    best = optimal_rater(certain(200), weight=0.0, cells=20)
    assert (best.actions[1:] == 0).all()
    assert best.actions[0] == 1
    assert best.error < 1e-12
    assert best.score == pytest.approx(0.715793, abs=1e-6)


# --- the grid
# ----------------------------------------------------------------------------------------

TASKS = [Exploit(0.5, 0.5, 30), Damage(0.5, 0.5, 30, 1 / 3, 2.0, 0.1)]


@pytest.mark.parametrize("task", TASKS)
def test_more_levels_never_lower_the_value(task):
    values = [grid.start_value(task, grid.backward(task, levels, 40)) for levels in (4, 8, 16, 32)]
    assert values == sorted(values)


def test_more_points_lower_the_providers_value_to_what_is_reached():
    """V is convex in ToP, being the best of many linear plays, so interpolation only ever
    overestimates it."""
    task, points = TASKS[0], (5, 10, 20, 40, 80, 160)
    tables = [grid.backward(task, 16, n) for n in points]
    values = [grid.start_value(task, table) for table in tables]
    reached = grid.total(task, grid.forward(task, tables[-1], finer=1))
    assert values == sorted(values, reverse=True)
    assert reached <= values[-1] < reached * (1 + 1e-4)


@pytest.mark.parametrize("task", TASKS)
def test_refining_the_grid_mends_the_error_and_never_the_score(task):
    found = [grid.solve(task, cells) for cells in (8, 24, 72)]
    errors, scores = [f.error for f in found], [f.score for f in found]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.01 * scores[-1]
    # The score of a coarse grid is reached too, so the fine grid's error must cover what the coarse
    # one missed.
    for coarse in found:
        assert scores[-1] - 1e-6 <= coarse.score + coarse.error
        assert coarse.score <= scores[-1] + errors[-1]


@pytest.mark.parametrize("task", TASKS)
def test_polishing_only_improves(task):
    played = grid.forward(task, grid.backward(task, 8, 8))
    polished = grid.polish(partial(grid.total, task), played)
    assert grid.total(task, polished) > grid.total(task, played)
    assert ((polished >= 0) & (polished <= 1)).all()


# --- refusals
# ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"noise": 0.01}, "noise"),
        ({"perturbations": [{"start": 1, "stop": 2}]}, "perturbed"),
        ({"ratings": {"lost": 0.1}}, "lost"),
        ({"access": {"kind": "choice"}}, "everyone"),
        ({"admission": {"threshold": 0.1}}, "cut"),
        ({"service": "hog"}, "camera"),
        ({"continuation": 0.9}, "random"),
        ({"agents": [{"role": "SR+SP", "count": 3}]}, "roles"),
        ({"agents": [{"role": "SR", "count": 3, "leaves": 9}, {"role": "SP"}]}, "come"),
    ],
)
def test_scenarios_with_luck_are_refused(changes, word):
    for optimal in (optimal_provider, optimal_rater):
        with refuses(ValueError, word):
            optimal(certain(20).change(**changes))


@pytest.mark.parametrize("cells", [0, -4, 3, 10, 8.0])
def test_grids_that_cannot_be_halved_twice_are_refused(cells):
    with refuses(ValueError, "cells", cells):
        optimal_provider(certain(5), cells=cells)


@pytest.mark.parametrize(
    "argument",
    [
        {"compromised": 0},
        {"compromised": 3},
        {"compromised": 1.5},
        {"weight": -1.0},
        {"tolerance": np.nan},
    ],
)
def test_arguments_out_of_range_are_refused(argument):
    with refuses(ValueError, *argument, *argument.values()):
        optimal_rater(certain(5), **argument)


def test_a_registered_scenario_says_all_that_is_in_the_way():
    with refuses(ValueError, "paper-3x3", "noise"):
        exact.check_certain(make_scenario("paper-3x3"))
