"""Evolution strategy of a coalition: its slope on a plane, what it learns, and what a run keeps."""

import numpy as np
import pytest
from refusals import refuses
from small_market import TASK, assert_continues, run

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet, random_weights
from roletrust_agents.training.coalition_methods import (
    EvolutionSearch,
    EvolutionStrategySearch,
)
from roletrust_agents.training.coalition_ppo import CoalitionPpo
from roletrust_agents.training.evolution_strategy import EvolutionStrategy, slope_of
from roletrust_agents.training.settings import StrategySettings
from roletrust_env.evaluation.attackers import read_record, record_of
from roletrust_env.evaluation.measurement import HELD_OUT, mean_rewards
from roletrust_env.evaluation.search import Budget, UnsuitableError
from roletrust_env.game.make_task import make_task

SMALL = StrategySettings(games=2, pairs=4, units=4, candidates=3, validation=8, validate_every=2)


def begun(*models, budget=2_000, **changes):
    tasks = [make_task(**TASK, trust_model=model) for model in models or ("beta",)]
    return EvolutionStrategy(tasks, SMALL.model_copy(update=changes), 0, budget)


def test_the_slope_is_that_of_the_formula():
    noise = np.random.default_rng(0).standard_normal((3, 5))
    scores = np.array([0.5, -1.0, 3.0, 0.0, 2.0, 1.0])
    ranks = {score: place / 5 - 0.5 for place, score in enumerate(sorted(scores))}
    expected = np.zeros(5)
    for k in range(3):
        expected += (ranks[scores[k]] - ranks[scores[k + 3]]) * noise[k] / (6 * 0.2)
    np.testing.assert_allclose(slope_of(scores, noise, 0.2), expected)


def test_the_slope_points_up_a_plane():
    up, noise = np.arange(1.0, 6.0), np.random.default_rng(1).standard_normal((2_000, 5))
    slope = slope_of(np.concatenate([noise @ up, -noise @ up]), noise, 1.0)
    assert slope @ up / np.linalg.norm(slope) / np.linalg.norm(up) > 0.99


def test_equal_scores_have_noslope_of():
    noise = np.random.default_rng(0).standard_normal((3, 5))
    assert not slope_of(np.ones(6), noise, 1.0).any()


def test_it_learns():
    strategy = begun(budget=30_000, games=8, pairs=8, validation=64, validate_every=5)
    first = strategy.best.score
    run(strategy, 20)
    assert strategy.best.score > first + 0.05


def test_it_steps_while_the_rounds_allow_it():
    strategy = begun("beta", "median", budget=10_000)
    validated = list(strategy.within(10_000))
    assert strategy.rounds <= 10_000 < strategy.rounds + strategy.most_rounds
    assert validated[-1]
    assert len(validated) == strategy.steps


def test_several_models_take_turns():
    strategy = begun("beta", "median", "mean")
    turns = []
    for _ in range(3):
        turns.append(strategy.turn)
        strategy.step()
    assert turns == [[0, 1], [2, 0], [1, 2]]


def test_a_run_continues_to_the_last_bit():
    assert_continues(begun, steps=3)


def test_the_search_keeps_to_its_budget_and_is_repeatable():
    found = [
        EvolutionStrategySearch(pairs=4, games=2).search(TASK, Budget(9_000), 3) for _ in range(2)
    ]
    assert found[0].rounds <= 9_000
    assert "evolution strategy" in found[0].description
    one, other = (search.attacker.network.flatten() for search in found)
    assert np.array_equal(one, other)
    assert found[0].progress == found[1].progress != ()


def test_a_known_attack_is_the_least():
    known = EvolutionStrategySearch(start="random", pairs=4, games=2, wide=False).search(
        TASK, Budget(6_000), 0
    )
    record = record_of(known.attacker)
    again = EvolutionStrategySearch(known=(record,), pairs=4, games=2, wide=False).search(
        TASK, Budget(6_000), 0
    )
    assert (
        max(score for _, score in again.progress)
        >= max(score for _, score in known.progress) - 1e-9
    )


def test_a_search_starts_from_the_best_of_the_known_attacks():
    best = EvolutionStrategySearch(start="random", pairs=4, games=2, wide=False).search(
        TASK, Budget(6_000), 0
    )
    architecture, random = best.attacker.network.architecture, np.random.default_rng(1)
    others = [
        CoalitionAttacker(DeepSet.unflatten(architecture, random_weights(architecture, random)))
        for _ in "123"
    ]
    alone, last = [
        EvolutionStrategySearch(
            known=tuple(map(record_of, known)), pairs=4, games=2, wide=False
        ).search(TASK, Budget(7_000), 3)
        for known in ([best.attacker], [*others, best.attacker])
    ]
    assert last.rounds <= 7_000
    assert last.progress[0][1] == alone.progress[0][1]


@pytest.mark.parametrize(
    ("method", "fields", "words"),
    [
        (EvolutionStrategySearch, {"pairs": 1}, ("pairs", "1")),
        (EvolutionSearch, {"population": 1}, ("population", "1")),
        (CoalitionPpo, {"gamma": 2}, ("gamma", "2")),
    ],
)
def test_parameters_are_checked_before_a_search(method, fields, words):
    with refuses(ValueError, *words):
        method(**fields)


def test_a_budget_that_is_too_small_is_refused():
    with refuses(UnsuitableError, "100"):
        EvolutionStrategySearch().search(TASK, Budget(100), 0)


def test_a_wide_search_finds_providers_that_treat_raters():
    """Where raters go by their own services alone, only bad service hurts, and unequal service
    hurts
    most."""
    agents = [
        {"role": "SR", "count": 8, "noise": 0.05},
        {"role": "SP", "count": 6, "ability": [0.3, 1.0]},
    ]
    market = {
        **TASK,
        "compromised": ("sp_4", "sp_5"),
        "agents": agents,
        "max_cycles": 20,
        "ratings": {"lost": 0.5},
    }
    market |= {"trust_model": "own-experience", "consumers": "raters"}
    task, rewards = make_task(**market, like=np.zeros(())), {}
    for wide in (False, True):
        found = EvolutionStrategySearch(wide=wide).search(market, Budget(30_000), 1).attacker
        rewards[wide] = mean_rewards(task, found, 0, (1, 100), HELD_OUT)[0].mean()
    assert rewards[True] > 1.08 * rewards[False]
    assert read_record(record_of(found)).network.architecture.wide


def test_a_wide_training_continues():
    assert_continues(lambda: begun(wide=True), 3)
