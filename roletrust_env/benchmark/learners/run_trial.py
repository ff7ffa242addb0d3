"""Playing a trial: from its name in a suite to what was measured, the same wherever it is played."""

from time import perf_counter

from roletrust_env.benchmark.learners.contestants import contestant
from roletrust_env.benchmark.learners.suite import LearnersSuite, Trial
from roletrust_env.benchmark.schema import AttackResult, CellResult
from roletrust_env.evaluation.search import UnsuitableError, find


def play_trial(suite: LearnersSuite, trial: Trial) -> CellResult:
    """Play a trial.

    Args:
        suite: that it is of.
        trial: to be played.

    Raises:
        ValueError: nobody has the learner's name, or it fails.
    """
    began, task = perf_counter(), suite.tasks[trial.task]
    rung, arguments = contestant(trial.learner, task.id), task.arguments()
    try:
        found = find(rung, arguments, budget=trial.budget, seed=trial.seed, games=suite.games)
    except UnsuitableError as error:
        return CellResult((), perf_counter() - began, unsuitable=str(error))
    measured: dict[str, list[float | None]] = {"score": found.scores.tolist()}
    if found.bound is not None:
        measured["bound"] = [found.bound]
    row = AttackResult(trial.learner, found.description, found.rounds, {}, measured)
    steps = found.rounds + suite.games * arguments["scenario"].max_cycles
    return CellResult((row,), perf_counter() - began, env_steps=steps)
