"""Results of a learners' suite: shares of the optimum that learners reach, aggregated over tasks
and seeds.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from roletrust_env.benchmarking.learners.learner import HONEST_PLAY
from roletrust_env.benchmarking.learners.suite import LearnersSuite, Trial
from roletrust_env.benchmarking.schema import CellResult
from roletrust_env.evaluation.search import bounds
from roletrust_env.metrics.confidence import Interval, interquartile_mean

ALL_TASKS = "all tasks"
"""Name of the task in results over all tasks."""

HEADER = ("task", "learner", "budget", "runs", "score", "share", "share_low_95", "share_high_95")
"""Column names of a table of results."""


class LearnerRun(NamedTuple):
    """Score of one learner on one task with one budget and one seed.

    Attributes:
        task: Name of the task.
        learner: Name of the learner.
        budget: Budget in game rounds.
        seed: Random seed.
        score: Mean reward per round in the held-out games.
    """

    task: str
    learner: str
    budget: int
    seed: int
    score: float


class TaskScale(NamedTuple):
    """Scores with share 0 and share 1 on a task.

    Attributes:
        honest_scores: Score of honest play by seed, in the held-out games of that seed. Its share
            is 0.
        top_score: Score with share 1.
        description: Description of the top score.
    """

    honest_scores: dict[int, float]
    top_score: float
    description: str

    def share(self, run: LearnerRun) -> float:
        """Return the share of a run between honest play and the top score. NaN if the top score is
        not higher.

        Args:
            run: Run on the task.
        """
        difference = self.top_score - float(np.mean(list(self.honest_scores.values())))
        return (run.score - self.honest_scores[run.seed]) / difference if difference > 0 else np.nan


class LearnerResult(NamedTuple):
    """Result of a learner with a budget.

    Attributes:
        task: Name of the task, or `ALL_TASKS`.
        learner: Name of the learner.
        budget: Budget in game rounds.
        runs: Number of runs.
        score: Mean score. NaN for `ALL_TASKS`, since the rewards of different tasks are not
            comparable.
        share: Interquartile mean of the shares, with its 95% interval.
    """

    task: str
    learner: str
    budget: int
    runs: int
    score: float
    share: Interval


def make_scale(
    honest: Sequence[LearnerRun], tops: dict[str, float], runs: Sequence[LearnerRun]
) -> TaskScale:
    """Return the scale of a task.

    Args:
        honest: Runs of honest play, one for each seed.
        tops: Known upper bounds of the score, by name.
        runs: Runs of the learners. Without a bound the top score is the highest mean over the seeds
            of a learner and a budget.
    """
    honest_scores = {run.seed: run.score for run in honest}
    for name, top in tops.items():
        return TaskScale(honest_scores, top, f"the bound {name!r}")
    means = {key: float(np.mean(scores)) for key, scores in _group_scores(runs).items()}
    if not means:
        return TaskScale(honest_scores, np.nan, "not known")
    (learner, budget), top = max(means.items(), key=lambda item: item[1])
    return TaskScale(
        honest_scores, top, f"the best that was found, by {learner} with {budget:,} rounds"
    )


def aggregate(scales: dict[str, TaskScale], runs: Sequence[LearnerRun]) -> list[LearnerResult]:
    """Return the results of each learner with each budget on each task, and over all tasks if it
    has runs on each.
    """
    results = []
    for learner, budget in _group_scores(runs):
        groups = {
            task: [run for run in runs if run[:3] == (task, learner, budget)] for task in scales
        }
        shares = {
            task: np.array([scales[task].share(run) for run in group])
            for task, group in groups.items()
        }
        if all(groups.values()):
            share = interquartile_mean(list(shares.values()))
            results.append(
                LearnerResult(
                    ALL_TASKS, learner, budget, sum(map(len, groups.values())), np.nan, share
                )
            )
        for task, group in groups.items():
            if group:
                score, share = (
                    float(np.mean([run.score for run in group])),
                    interquartile_mean([shares[task]]),
                )
                results.append(LearnerResult(task, learner, budget, len(group), score, share))
    return results


def ranking(results: Sequence[LearnerResult]) -> list[str]:
    """Return the names of the learners from the best to the worst, over all tasks with the largest
    budget.
    """
    largest = max((result.budget for result in results), default=0)
    shares = {
        learner_result.learner: learner_result.share.value
        for learner_result in results
        if learner_result.task == ALL_TASKS and learner_result.budget == largest
    }
    names = dict.fromkeys(result.learner for result in results)
    return sorted(names, key=lambda name: -np.nan_to_num(shares.get(name, np.nan), nan=-np.inf))


def table_rows(results: Sequence[LearnerResult]) -> list[tuple[object, ...]]:
    """Return the rows of a table with the columns of `HEADER`."""
    return [(*result[:5], *result.share) for result in results]


def _group_scores(runs: Sequence[LearnerRun]) -> dict[tuple[str, int], list[float]]:
    """Return the scores of each learner and budget."""
    scores: dict[tuple[str, int], list[float]] = {}
    for run in runs:
        scores.setdefault((run.learner, run.budget), []).append(run.score)
    return scores


def learner_results(
    suite: LearnersSuite, stored: Sequence[tuple[Trial, CellResult]]
) -> tuple[dict[str, TaskScale], list[LearnerResult]]:
    """Return the scale of each task that has been played, and the results of the learners."""
    runs: list[LearnerRun] = []
    tops: dict[str, dict[str, float]] = {task: {} for task in suite.tasks}
    for trial, result in stored:
        for row in result.rows:
            runs.append(
                LearnerRun(*trial, float(np.mean(np.array(row.measured["score"], np.float64))))
            )
            if bound := row.measured.get("bound"):
                tops[trial.task][trial.learner] = float(bound[0] or 0.0)
    honest = {
        task: [run for run in runs if (run.task, run.learner) == (task, HONEST_PLAY)]
        for task in suite.tasks
    }
    seeds = {task: {run.seed for run in group} for task, group in honest.items()}
    learners = [
        run
        for run in runs
        if run.learner not in (HONEST_PLAY, *bounds.names()) and run.seed in seeds[run.task]
    ]
    scales = {
        task: make_scale(honest[task], tops[task], [run for run in learners if run.task == task])
        for task in suite.tasks
        if honest[task]
    }
    return scales, aggregate(scales, learners)
