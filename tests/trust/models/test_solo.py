"""Choice rules of judges that listen to nobody, by hand and in games."""

from math import log, sqrt
from typing import Any

import numpy as np
import pytest
from judged import play

from roletrust_baselines import BadMouthing
from roletrust_env import Game, JointPolicy, Scenario, record
from roletrust_env.trust import make_trust_model

SOLO = ["solo-subsampled", "solo-thompson", "solo-threshold", "solo-ucb"]
NOISE = np.array([[0.4, 0.3, 0.2]])


def wanted(name: str, *rounds: Any, **parameters: Any) -> np.ndarray:
    """The preferences of a single judge after rounds of ratings; None is no service."""
    model = make_trust_model(name, **parameters)
    preference: np.ndarray = model.preference(play(model, *rounds), NOISE)[0]
    return preference


def test_upper_confidence_is_its_formula() -> None:
    rounds = [[[0.5, 0.9, None]], [[0.7, None, None]]]
    values = wanted("solo-ucb", *rounds, width=0.5)
    assert values[0] == pytest.approx(0.6 + 0.5 * sqrt(2 * log(3) / 2))
    assert values[1] == pytest.approx(0.9 + 0.5 * sqrt(2 * log(3)))
    assert values.argmax() == 2  # it has not met this one


def test_thompson_draws_with_the_mean_and_the_spread_of_a_beta_distribution() -> None:
    model = make_trust_model("solo-thompson")
    state = play(model, *[[[0.8]]] * 10)
    noise = (np.arange(100_000) + 0.5) / 100_000
    draws = np.array([model.preference(state, np.array([[u]]))[0, 0] for u in noise[::100]])
    mean, n = 9 / 12, 10
    assert draws.mean() == pytest.approx(mean, abs=1e-3)
    assert draws.std() == pytest.approx(sqrt(mean * (1 - mean) / (n + 3)), rel=0.02)


def test_a_threshold_ends_the_search_and_starts_it_again() -> None:
    good, bad = [[None, 0.9, None]], [[None, 0.3, None]]
    assert wanted("solo-threshold", good).argmax() == 1
    assert wanted("solo-threshold", good, bad).argmax() == 0  # the first of those it has not met
    assert wanted("solo-threshold", good, level=0.95).argmax() == 0


def test_a_sample_is_tried_once_and_its_best_is_kept() -> None:
    rounds = [[[None, 0.2, None]], [[None, None, 0.4]]]
    assert wanted("solo-subsampled", *rounds, sample=3).argmax() == 0
    assert wanted("solo-subsampled", *rounds, sample=2).argmax() == 2


@pytest.mark.parametrize("name", ["own-experience", *SOLO])
def test_nothing_depends_on_lost_reports_or_on_liars(name: str) -> None:
    agents = [
        {"role": "SR", "count": 5, "noise": 0.1},
        {"role": "SP", "count": 6, "ability": (0, 1)},
    ]
    by = "own" if name == "own-experience" else "model"
    scenario = Scenario(agents=agents, access={"kind": "choice", "by": by}, max_cycles=30)
    served = []
    for ratings, liars in (({}, 0), ({"lost": 0.9}, 0), ({}, 4)):
        game = Game(scenario.change(ratings=ratings), name)
        policies = {f"sr_{n}": BadMouthing(start=0, level=0.0) for n in range(1, 1 + liars)}
        served.append(record(JointPolicy(game, policies), game.random(3), (4,)).served)
    assert np.array_equal(served[0], served[1])
    assert np.array_equal(served[0], served[2])
    assert served[0].sum(axis=2).min() == 1
