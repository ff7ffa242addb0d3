"""Execution of a trial. The result depends only on the suite and the trial, not on the machine or the order."""

from time import perf_counter

from roletrust_env.benchmarking.learners.search_methods import make_search_method
from roletrust_env.benchmarking.learners.suite import LearnersSuite, Trial
from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.evaluation.search import UnsuitableError, find


def play_trial(suite: LearnersSuite, trial: Trial) -> CellResult:
    """Play a trial.

    Args:
        suite: Suite of the trial.
        trial: Trial to play.

    Raises:
        ValueError: The name of the learner is unknown, or the learner fails.
    """
    began, task = perf_counter(), suite.tasks[trial.task]
    method, arguments = make_search_method(trial.learner, task.id), task.arguments()
    try:
        attempt = find(method, arguments, budget=trial.budget, seed=trial.seed, games=suite.games)
    except UnsuitableError as error:
        return CellResult((), perf_counter() - began, unsuitable=str(error))
    measured: dict[str, list[float | None]] = {"score": attempt.scores.tolist()}
    if attempt.bound is not None:
        measured["bound"] = [attempt.bound]
    row = AttackResult(trial.learner, attempt.description, attempt.rounds, {}, measured)
    steps = attempt.rounds + suite.games * arguments["scenario"].max_cycles
    return CellResult((row,), perf_counter() - began, env_steps=steps)
