"""The results of a learners' suite, from what its trials came to."""

from collections.abc import Sequence

import numpy as np

from roletrust_env.benchmark.learners.shares import Result, Run, Scale, results, scale
from roletrust_env.benchmark.learners.suite import FOOT, TOPS, LearnersSuite, Trial
from roletrust_env.benchmark.schema import CellResult

_WORDS = dict(zip(TOPS, ("the exact optimum", "a bound that is proven"), strict=True))


def title(suite: LearnersSuite) -> str:
    """Of a picture of the results."""
    return f"Learners, suite {suite.name}, {len(suite.seeds)} seeds"


def standings(suite: LearnersSuite, kept: Sequence[tuple[Trial, CellResult]]) -> tuple[dict[str, Scale], list[Result]]:
    """What share 0 and 1 are on each task that has been played, and what each learner reaches.

    Args:
        suite: of the run.
        kept: its trials, with what became of them.
    """
    runs: list[Run] = []
    bounds: dict[str, dict[str, float]] = {task: {} for task in suite.tasks}
    for trial, done in kept:
        for row in done.rows:
            runs.append(Run(*trial, float(np.mean(np.array(row.measured["score"], np.float64)))))
            if bound := row.measured.get("bound"):
                bounds[trial.task][_WORDS[trial.learner]] = float(bound[0] or 0.0)
    foot = {task: [run for run in runs if (run.task, run.learner) == (task, FOOT)] for task in suite.tasks}
    seeds = {task: {run.seed for run in some} for task, some in foot.items()}
    learners = [run for run in runs if run.learner not in (FOOT, *TOPS) and run.seed in seeds[run.task]]
    scales = {
        task: scale(foot[task], bounds[task], [run for run in learners if run.task == task])
        for task in suite.tasks
        if foot[task]
    }
    return scales, results(scales, learners)
