"""Suites for learners, their trials, and what these come to."""

from collections import Counter

import pytest

from roletrust_env.benchmark.learners.leaderboard import standings
from roletrust_env.benchmark.learners.run_trial import play_trial
from roletrust_env.benchmark.learners.shares import EVERY
from roletrust_env.benchmark.learners.suite import FOOT, TOPS, LearnersSuite, Trial, trials
from roletrust_env.benchmark.schema import AttackResult, CellResult
from roletrust_env.benchmark.store import Store, StoredCell
from roletrust_env.benchmark.suite import load_suite, read_suite
from roletrust_env.benchmark.suite_types import suite_type

SHORT = {"max_cycles": 12, "noise": 0.0, "perturbations": []}


def small(**fields) -> LearnersSuite:
    tasks = {
        "provider": {"task": "ProviderAttack", "set": SHORT},
        "dual": {"task": "DualAttack", "set": {"max_cycles": 12}},
    }
    usual = {"kind": "learners", "tasks": tasks, "learners": ["CMA-ES"], "budgets": [2000, 4000], "games": 4}
    return read_suite(usual | {"seeds": [3, 4]} | fields, "small")


def test_every_learner_has_every_task_budget_and_seed_once():
    suite = small(learners=["CMA-ES", "PPO"])
    found = trials(suite)
    assert len({trial.key for trial in found}) == len(found)
    assert Counter(trial.learner for trial in found) == {"CMA-ES": 8, "PPO": 8, FOOT: 4, "exact": 2, "best known": 2}
    budgets = [trial.budget for trial in found]
    assert budgets == sorted(budgets, reverse=True)  # the longest first


def test_a_trial_is_that_of_the_ladder():
    suite = small()
    done = play_trial(suite, Trial("provider", "CMA-ES", 4000, 3))
    (row,) = done.rows
    assert (row.attack, len(row.measured["score"]), row.chosen) == ("CMA-ES", 4, {})
    assert 3000 < row.rounds <= 4000
    assert done.env_steps == row.rounds + 4 * 12
    again = play_trial(suite, Trial("provider", "CMA-ES", 4000, 3))
    assert again._replace(seconds=0) == done._replace(seconds=0)
    assert "too small" in play_trial(suite, Trial("provider", "CMA-ES", 100, 3)).unsuitable
    assert play_trial(suite, Trial("dual", "exact", 0, 3)).unsuitable


def test_the_exact_optimum_is_share_1(tmp_path):
    suite = small(seeds=[3])
    with Store(tmp_path / "results.sqlite", suite) as store:
        for trial in trials(suite):
            store.add(trial, play_trial(suite, trial))
        kept = store.all()
        assert store.finished() == {trial.key for trial in trials(suite)}
    assert {one.cell for one in kept} == set(trials(suite))
    scales, found = standings(suite, kept)
    assert scales["provider"].words == "the exact optimum"
    assert scales["dual"].words.startswith("the best that was found, by CMA-ES with")
    shares = {(one.task, one.budget): one.share.value for one in found}
    assert 0.3 < shares["provider", 4000] < 1
    assert max(shares["dual", 2000], shares["dual", 4000]) == pytest.approx(1)
    assert shares[EVERY, 4000] == pytest.approx((shares["provider", 4000] + shares["dual", 4000]) / 2)
    assert Store(tmp_path / "results.sqlite").suite == suite


def test_a_run_of_another_kind_is_not_gone_on_with(tmp_path):
    with Store(tmp_path / "results.sqlite", small()):
        pass
    with pytest.raises(ValueError, match="holds another suite"):
        Store(tmp_path / "results.sqlite", load_suite("quick"))


def test_without_honest_play_there_is_no_scale():
    """A run that was stopped early, or whose reference failed, tells what it can and no more."""
    suite = small()
    row = AttackResult("CMA-ES", "", 0, {}, {"score": [0.5] * 4})
    ran = [StoredCell(Trial("provider", "CMA-ES", 4000, seed), CellResult((row,), 1.0)) for seed in suite.seeds]
    assert standings(suite, ran) == ({}, [])
    honest = AttackResult(FOOT, "", 0, {}, {"score": [0.1] * 4})
    ran += [StoredCell(Trial("provider", FOOT, 0, 3), CellResult((honest,), 1.0))]
    scales, found = standings(suite, ran)
    assert list(scales) == ["provider"]
    assert {one.runs for one in found} == {1}  # that with the same seed


@pytest.mark.parametrize("name", ["learners", "learners-quick"])
def test_the_suites_that_come_with_the_project_can_be_played(name):
    suite = load_suite(name)
    assert isinstance(suite, LearnersSuite)
    assert suite_type(suite).cells(suite) == trials(suite)
    assert set(TOPS) < {trial.learner for trial in trials(suite)}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"kind": "dancers"}, "kind is 'dancers'; it must be one of robustness, learners"),
        ({"tasks": {}}, "tasks"),
        ({"tasks": {"one": {"task": "MoonAttack"}}}, "tasks.one.task is 'MoonAttack'"),
        ({"tasks": {"one": {"task": "DualAttack", "set": {"lamb": 1}}}}, "lamb"),
        ({"tasks": {"one": {"task": "DualAttack", "stealth": {"wait": 1}}}}, "wait"),
        ({"budgets": [4000, 2000]}, "budgets must rise"),
        ({"budgets": [2000, 2000]}, "budgets must rise"),
        ({"learners": []}, "learners"),
        ({"learners": ["PPO", "PPO"]}, "learners has something twice"),
        ({"learners": ["exact"]}, "learners has 'exact', which is played anyway"),
        ({"seeds": []}, "seeds must have one at least"),
        ({"rungs": ["PPO"]}, "there is no field 'rungs'"),
    ],
)
def test_a_suite_that_cannot_be_played_is_refused(fields, message):
    with pytest.raises(ValueError, match=message) as found:
        small(**fields)
    assert str(found.value).startswith("small: ")
