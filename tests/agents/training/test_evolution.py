"""Evolution of coalitions, and the search methods that use it."""

import numpy as np
import pytest
from refusals import refuses
from small_market import TASK, run

pytest.importorskip("cma")

from roletrust_agents.learned.deep_set import DeepSetArchitecture
from roletrust_agents.training.coalition_methods import EvolutionSearch
from roletrust_agents.training.evolution import Evolution
from roletrust_agents.training.settings import EvolutionSettings
from roletrust_agents.training.universal import Universal, known_starts, universal_coalitions
from roletrust_env.evaluation.search import Budget, UnsuitableError, find
from roletrust_env.game.make_task import make_task

SMALL = EvolutionSettings(
    population=6,
    games=2,
    units=4,
    candidates=3,
    validation=4,
    validate_every=2,
    starts=1,
    wide=False,
)
RACE = SMALL.model_copy(update={"candidates": 8, "starts": 4})


def tasks(*models):
    return [make_task(**TASK, trust_model=model) for model in models or ("beta",)]


def evolved(generations, seed=0, known=(), of=None, settings=SMALL):
    return run(Evolution(of or tasks(), settings, seed, 10_000, known), generations)


def test_the_same_seed_finds_the_same_network():
    one, again, other = (evolved(4, seed).network.flatten() for seed in (1, 1, 2))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)


def test_it_does_not_touch_the_global_random_numbers():
    np.random.seed(5)  # noqa: NPY002
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    evolved(2)
    assert np.array_equal(before, np.random.get_state()[1])  # noqa: NPY002


@pytest.mark.parametrize("settings", [SMALL, RACE], ids=["one start", "several"])
@pytest.mark.parametrize("stopped", [3, 13])
def test_a_run_continues_from_its_scores(settings, stopped):
    whole = evolved(15, settings=settings)
    again = Evolution(tasks(), settings, 0, 10_000)
    again.restore(evolved(stopped, settings=settings).state())
    for _ in range(15 - stopped):
        again.step()
    assert [scores.tolist() for scores in whole.scores] == [
        scores.tolist() for scores in again.scores
    ]
    assert np.array_equal(whole.weights, again.weights)


def test_the_worse_half_of_the_starts_is_dropped_until_one_is_left():
    """4 starts have 16 generations in common, then 2 have 16; the others of 83 belong to the best
    one."""
    evolution = evolved(14, settings=RACE)
    assert [len(scores) for scores in evolution.scores] == [4] * 4 + [2] * 8 + [1] * 2
    halves = [
        np.mean([scores.mean(axis=1) for scores in evolution.scores[at - 3 : at]], axis=0)
        for at in (4, 12)
    ]
    again = Evolution(tasks(), RACE, 0, 10_000)
    strategies = list(again._strategies)
    again.restore(evolution.state())
    kept = sorted(np.argsort(-halves[0])[:2])
    assert again._strategies == [strategies[kept[int(np.argmax(halves[1]))]]]
    played = 4 * 4 + 2 * 8 + 2  # generations
    assert evolution.rounds == 10 * (
        8 * 4 + played * 6 * 2 + 7 * 4
    )  # the choice of starts, and seven validations


def test_a_budget_for_few_generations_has_one_start():
    assert len(Evolution(tasks(), RACE, 0, 7_000)._strategies) == 1
    assert len(Evolution(tasks(), RACE, 0, 7_300)._strategies) == 4
    assert (
        len(Evolution(tasks(), RACE.model_copy(update={"starts": 3}), 0, 10_000)._strategies) == 2
    )


def test_it_learns():
    evolution = Evolution(
        tasks(), SMALL.model_copy(update={"games": 8, "validation": 64}), 0, 100_000
    )
    first = evolution.validate().mean
    for _ in range(40):
        evolution.step()
    assert evolution.validate().mean > first + 0.03


def test_it_begins_with_the_best_known_network_and_does_not_end_below_it():
    weights = evolved(30).best.weights
    known = [np.zeros_like(weights), weights, weights[:-1]]
    evolution = Evolution(tasks(), SMALL, 3, 10_000, known)
    assert np.array_equal(evolution.weights, weights)
    assert np.array_equal(evolution.network.flatten(), weights.astype(np.float32))
    assert evolution.rounds == 10 * (
        5 * 4 + 2 * 4
    )  # five networks in a few games, then a validation of the known ones
    wild = Evolution(tasks(), SMALL.model_copy(update={"spread": 50.0}), 3, 10_000, known)
    first = wild.best.score
    for _ in range(3):
        wild.step()
        wild.validate()
    assert wild.best.score >= first


def test_all_rounds_are_counted():
    evolution = evolved(2)
    assert evolution.rounds == 10 * (
        3 * 4 + 2 * 6 * 2 + 4
    )  # the start, two generations, one validation
    two = evolved(2, of=tasks("beta", "qor", "mean"))
    assert two.rounds == 10 * 3 * 3 * 4 + 10 * (2 * 2 * 6 * 2 + 3 * 4)


def test_a_search_stays_in_its_budget():
    budget = Budget(30_000)
    result = EvolutionSearch(population=8, games=4).search(
        {**TASK, "trust_model": "beta"}, budget, 0
    )
    assert budget.spent == result.rounds <= 30_000
    assert budget.spent > 20_000
    played, best = zip(*result.progress, strict=True)
    assert list(played) == sorted(played)
    assert played[-1] <= budget.spent
    assert list(best) == sorted(best)  # of all so far
    assert len(set(played)) == len(played) > 1


def test_where_nothing_is_left_to_chance_one_game_each_is_enough():
    certain = {"scenario": "paper-3x3", "max_cycles": 40, "noise": 0.0, "perturbations": []}
    arguments = {**certain, "compromised": ["sp_2"], "objective": "exploit"}
    with refuses(UnsuitableError, "2799", "2800"):  # 4 x (16 candidates + 1 validation) + 2 games
        EvolutionSearch(population=16, wide=False).search(arguments, Budget(2799), 0)
    found = find(
        EvolutionSearch(start="random", population=16, wide=False),
        arguments,
        budget=32_000,
        seed=0,
        games=2,
    )
    assert "in 45 steps" in found.description
    assert found.scores[0] > 0.2  # on and off in cycles; quality 0 all the time is worth 0.03


def test_too_small_a_budget_is_refused_with_one_that_is_enough():
    with refuses(UnsuitableError, "100") as error:
        EvolutionSearch().search({**TASK, "trust_model": "beta"}, Budget(100), 0)
    enough = int(str(error.value).split("give ")[1].split()[0])
    assert (
        EvolutionSearch().search({**TASK, "trust_model": "beta"}, Budget(enough), 0).rounds
        <= enough
    )


def test_the_universal_coalitions_come_with_the_project():
    ready = universal_coalitions(wide=False)
    in_the_crowd = {
        f"universal-{name}" for name in ("raters", "providers", "coalition", "identities")
    }
    in_the_market = {f"universal-{name}-market" for name in ("raters", "coalition", "identities")}
    assert set(ready) == in_the_crowd | in_the_market
    assert all(network.architecture == DeepSetArchitecture() for network in ready.values())
    treating = {f"universal-{name}-treatment" for name in ("providers", "coalition", "identities")}
    assert set(universal_coalitions()) == set(ready) | treating
    assert len(known_starts("alike")) == 5 * len(ready) == len(known_starts("universal")) - 3
    for found, many in ((Universal(wide=False), 7), (Universal(), 10)):
        result = found.search({**TASK, "trust_model": "beta"}, Budget(10_000), 0)
        assert result.rounds == many * 16 * 10
        assert result.description.split(",")[0] in set(ready) | treating
        with refuses(UnsuitableError, many * 160):
            found.search({**TASK, "trust_model": "beta"}, Budget(many * 160 - 1), 0)
