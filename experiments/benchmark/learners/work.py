"""Playing a trial: from its name in a suite to what was measured, the same wherever it is played."""

from time import perf_counter

from agents.ladder.rungs import UnsuitableError, find
from experiments.benchmark.learners.contestants import contestant
from experiments.benchmark.learners.suite import LearnersSuite, Trial
from experiments.benchmark.terms import Done, Row


def play_trial(suite: LearnersSuite, trial: Trial) -> Done:
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
        found = find(rung, arguments, budget=trial.budget, seed=trial.seed, games=suite.games, tell=lambda rounds: None)
    except UnsuitableError as error:
        return Done((), perf_counter() - began, unsuitable=str(error))
    measured: dict[str, list[float | None]] = {"score": found.scores.tolist()}
    if found.bound is not None:
        measured["bound"] = [found.bound]
    row = Row(trial.learner, found.words, found.rounds, {}, measured)
    steps = found.rounds + suite.games * arguments["scenario"].max_cycles
    return Done((row,), perf_counter() - began, env_steps=steps)
