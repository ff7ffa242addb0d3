"""Suites for learners, their trials and their results."""

from collections import Counter

import pytest
from refusals import refuses

from roletrust_env.benchmarking.learners.learner import HONEST_PLAY, make_search_method
from roletrust_env.benchmarking.learners.results import ALL_TASKS, learner_results
from roletrust_env.benchmarking.learners.suite import LearnersSuite, Trial, play_trial
from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.store import ResultStore, StoredCell
from roletrust_env.benchmarking.suite_files import load_suite, read_suite

SHORT = {"max_cycles": 12, "noise": 0.0, "perturbations": []}


def small(**fields) -> LearnersSuite:
    tasks = {
        "provider": {"task": "ProviderAttack", "set": SHORT},
        "dual": {"task": "DualAttack", "set": {"max_cycles": 12}},
    }
    defaults = {
        "kind": "learners",
        "tasks": tasks,
        "learners": ["CMA-ES"],
        "budgets": [2000, 4000],
        "games": 4,
    }
    return read_suite(defaults | {"seeds": [3, 4]} | fields, "small")


def test_every_learner_has_every_task_budget_and_seed_once():
    suite = small(learners=["CMA-ES", "PPO"])
    every = suite.cells()
    assert len({trial.key for trial in every}) == len(every)
    assert Counter(trial.learner for trial in every) == {
        "CMA-ES": 8,
        "PPO": 8,
        HONEST_PLAY: 4,
        "exact": 2,
        "best known": 2,
    }
    budgets = [trial.budget for trial in every]
    assert budgets == sorted(budgets, reverse=True)  # the longest first


def test_a_trial_is_reproducible():
    suite = small()
    result = play_trial(suite, Trial("provider", "CMA-ES", 4000, 3))
    (row,) = result.rows
    assert (row.attack, len(row.measured["score"]), row.chosen) == ("CMA-ES", 4, {})
    assert 3000 < row.rounds <= 4000
    assert result.env_steps == row.rounds + 4 * 12
    again = play_trial(suite, Trial("provider", "CMA-ES", 4000, 3))
    assert again._replace(seconds=0) == result._replace(seconds=0)
    assert "too small" in play_trial(suite, Trial("provider", "CMA-ES", 100, 3)).unsuitable
    assert play_trial(suite, Trial("dual", "exact", 0, 3)).unsuitable


def test_the_exact_optimum_is_share_1(tmp_path):
    suite = small(seeds=[3])
    with ResultStore(tmp_path / "results.sqlite", suite) as store:
        for trial in suite.cells():
            store.add(trial, play_trial(suite, trial))
        stored = store.all()
        assert store.finished_keys() == {trial.key for trial in suite.cells()}
    assert {one.cell for one in stored} == set(suite.cells())
    scales, results = learner_results(suite, stored)
    assert scales["provider"].description == "the bound 'exact'"
    assert scales["dual"].description.startswith("the best that was found, by CMA-ES with")
    shares = {(one.task, one.budget): one.share.value for one in results}
    assert 0.3 < shares["provider", 4000] < 1
    assert max(shares["dual", 2000], shares["dual", 4000]) == pytest.approx(1)
    assert shares[ALL_TASKS, 4000] == pytest.approx(
        (shares["provider", 4000] + shares["dual", 4000]) / 2
    )
    assert ResultStore(tmp_path / "results.sqlite").suite == suite


def test_a_run_of_another_suite_type_is_not_continued(tmp_path):
    with ResultStore(tmp_path / "results.sqlite", small()):
        pass
    with refuses(ValueError, "limit_s"):
        ResultStore(tmp_path / "results.sqlite", load_suite("quick"))


def test_without_honest_play_there_is_no_scale():
    """A run that was stopped early, or whose reference failed, has incomplete results."""
    suite = small()
    row = AttackResult("CMA-ES", "", 0, {}, {"score": [0.5] * 4})
    stored = [
        StoredCell(Trial("provider", "CMA-ES", 4000, seed), CellResult((row,), 1.0))
        for seed in suite.seeds
    ]
    assert learner_results(suite, stored) == ({}, [])
    honest = AttackResult(HONEST_PLAY, "", 0, {}, {"score": [0.1] * 4})
    stored += [StoredCell(Trial("provider", HONEST_PLAY, 0, 3), CellResult((honest,), 1.0))]
    scales, results = learner_results(suite, stored)
    assert list(scales) == ["provider"]
    assert {one.runs for one in results} == {1}  # only the run with the same seed


@pytest.mark.parametrize("task", ["liars", "coalition", "market"])
def test_the_coalitions_are_those_of_the_suite_for_all_learners(task):
    assert load_suite("learners").tasks[task].observation == "coalition"
    assert load_suite("learners-coalitions").tasks[task] == load_suite("learners").tasks[task]


def test_the_tasks_with_an_optimum_are_those_of_the_suite_of_all_learners():
    for task in ("provider", "rater"):
        assert load_suite("learners-optimum").tasks[task] == load_suite("learners").tasks[task]


def test_evolution_learns_from_scratch_or_says_why_it_cannot():
    suite = load_suite("learners")
    (name,) = [name for name in suite.learners if name.startswith("evolution")]
    assert make_search_method(name, suite.tasks["liars"].id).start == "random"
    assert (
        "too small for evolution" in play_trial(suite, Trial("liars", name, 25_000, 0)).unsuitable
    )
    with refuses(ValueError, "evolution", "begin"):
        make_search_method("evolution:begin=random", suite.tasks["liars"].id)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"kind": "dancers"}, ("kind", "dancers", "learners")),
        ({"tasks": {}}, ("tasks",)),
        ({"tasks": {"one": {"task": "MoonAttack"}}}, ("tasks.one.task", "MoonAttack")),
        ({"tasks": {"one": {"task": "DualAttack", "set": {"lamb": 1}}}}, ("lamb",)),
        ({"tasks": {"one": {"task": "DualAttack", "stealth": {"wait": 1}}}}, ("wait",)),
        ({"tasks": {"one": {"task": "DualAttack", "preset": ("moon",)}}}, ("moon",)),
        ({"tasks": {"one": {"task": "RaterAttack", "compromised": ["sr_7"]}}}, ("sr_7",)),
        ({"tasks": {"one": {"task": "DualAttack", "observation": "all"}}}, ("observation",)),
        ({"budgets": [4000, 2000]}, ("budgets",)),
        ({"budgets": [2000, 2000]}, ("budgets",)),
        ({"learners": []}, ("learners",)),
        ({"learners": ["PPO", "PPO"]}, ("learners",)),
        ({"learners": ["exact"]}, ("learners", "exact")),
        ({"seeds": []}, ("seeds", "1")),
        ({"methods": ["PPO"]}, ("methods",)),
    ],
)
def test_an_invalid_suite_is_refused(fields, words):
    with refuses(ValueError, "small", *words):
        small(**fields)


def test_a_search_method_is_also_taken_as_a_class():
    own = {
        "learners": ["own_search:OnePeriod:period=4"],
        "budgets": [100],
        "seeds": [0],
        "games": 2,
    }
    suite = read_suite({**load_suite("learners-quick").model_dump(), **own}, "own")
    method = make_search_method("own_search:OnePeriod:period=4", "RoleTrust/ProviderAttack-v0")
    assert (method.name, method.period) == ("one period", 4)
    assert list(suite.factories()) == ["learner own_search:OnePeriod:period=4"]
    (trial,) = [cell for cell in suite.cells() if cell.learner in suite.learners][:1]
    assert play_trial(suite, trial).rows[0].words == "period 4"
    with refuses(ValueError, "own_search:Nothing"):
        make_search_method("own_search:Nothing", "RoleTrust/ProviderAttack-v0")
