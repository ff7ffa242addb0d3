"""Runs of learners with random numbers in place of games, for tests of reports."""

from collections.abc import Sequence

import numpy as np

from roletrust_env.benchmarking.learners.learner import HONEST_PLAY
from roletrust_env.benchmarking.learners.suite import LearnersSuite, Trial
from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite_files import read_suite


def learners() -> LearnersSuite:
    """Return a suite of six learners on four tasks, two of which have a known optimum."""
    fields = {
        "learners": ["PPO", "recurrent PPO", "SAC", "CMA-ES", "random search", "white-box planner"]
    }
    tasks = {
        name.lower(): {"task": f"{name}Attack"}
        for name in ("Provider", "Rater", "Dual", "Collusion")
    }
    suite = read_suite(
        {"kind": "learners", "name": "large", "tasks": tasks, "seeds": range(5), **fields}, "large"
    )
    assert isinstance(suite, LearnersSuite)
    return suite


def stored_trials(suite: LearnersSuite) -> list[StoredCell]:
    """Return the trials of a suite with random results."""
    return [
        StoredCell(trial, CellResult(tuple(_trial_rows(suite, trial)), 1.0))
        for trial in suite.cells()
    ]


def _trial_rows(suite: LearnersSuite, trial: Trial) -> Sequence[AttackResult]:
    draw = np.random.default_rng(
        [trial.seed, trial.budget, len(trial.learner), list(suite.tasks).index(trial.task)]
    )
    if trial.learner == HONEST_PLAY:
        score = 0.05
    elif trial.learner in suite.learners:
        skill = 1 - suite.learners.index(trial.learner) / 8
        score = 0.05 + 0.6 * skill * (1 - np.exp(-trial.budget / 40_000)) + draw.normal(0, 0.03)
    elif trial.task in ("provider", "rater"):
        return [AttackResult(trial.learner, "", 0, {}, {"score": [0.7], "bound": [0.7]})]
    else:
        return []
    return [AttackResult(trial.learner, "", trial.budget, {}, {"score": [float(score)] * 2})]
