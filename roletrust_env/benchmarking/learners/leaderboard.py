"""Results of a learners' suite, computed from its trials."""

from collections.abc import Sequence

import numpy as np

from roletrust_env.benchmarking.learners.optimum_share import LearnerResult, LearnerRun, Scale, aggregate, make_scale
from roletrust_env.benchmarking.learners.suite import BOUNDS, HONEST_PLAY, LearnersSuite, Trial
from roletrust_env.benchmarking.schema import CellResult

_BOUND_DESCRIPTIONS = dict(zip(BOUNDS, ("the exact optimum", "a bound that is proven"), strict=True))


def title(suite: LearnersSuite) -> str:
    """Return the title of a figure of the results.

    Args:
        suite: Suite of the run.
    """
    return f"Learners, suite {suite.name}, {len(suite.seeds)} seeds"


def learner_results(
    suite: LearnersSuite, stored: Sequence[tuple[Trial, CellResult]]
) -> tuple[dict[str, Scale], list[LearnerResult]]:
    """Return the scale of each task that has been played, and the results of the learners.

    Args:
        suite: Suite of the run.
        stored: Trials of the run with their results.
    """
    runs: list[LearnerRun] = []
    bounds: dict[str, dict[str, float]] = {task: {} for task in suite.tasks}
    for trial, result in stored:
        for row in result.rows:
            runs.append(LearnerRun(*trial, float(np.mean(np.array(row.measured["score"], np.float64)))))
            if bound := row.measured.get("bound"):
                bounds[trial.task][_BOUND_DESCRIPTIONS[trial.learner]] = float(bound[0] or 0.0)
    honest = {task: [run for run in runs if (run.task, run.learner) == (task, HONEST_PLAY)] for task in suite.tasks}
    seeds = {task: {run.seed for run in some} for task, some in honest.items()}
    learners = [run for run in runs if run.learner not in (HONEST_PLAY, *BOUNDS) and run.seed in seeds[run.task]]
    scales = {
        task: make_scale(honest[task], bounds[task], [run for run in learners if run.task == task])
        for task in suite.tasks
        if honest[task]
    }
    return scales, aggregate(scales, learners)
