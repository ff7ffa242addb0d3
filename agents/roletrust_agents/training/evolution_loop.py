"""Training of a coalition by evolution, with checkpoints from which it continues to the last bit."""

from time import perf_counter

import numpy as np

from roletrust_agents.learned.saved import SavedAttacker, task_from_card
from roletrust_agents.training.coalition_methods import known_starts
from roletrust_agents.training.evolution import Evolution, Validated
from roletrust_agents.training.run import OnReport, Point, Report, Run, finish
from roletrust_agents.training.runs import Checkpoint, RunFolder
from roletrust_agents.training.settings import EvolutionSettings


def train(run: Run, folder: RunFolder, on_report: OnReport) -> tuple[SavedAttacker, list[Point]]:
    """Train from the folder's last checkpoint, or from the beginning, to the end.

    Args:
        run: Run to train.
        folder: Folder for checkpoints.
        on_report: Called with the progress after every generation.

    Returns:
        The coalition with the best score during training, measured again in new games, and the learning curve.
    """
    tasks = [task_from_card(run.task, model, run.scenario) for model in (run.trust_model, *run.further_models)]
    settings = EvolutionSettings.model_validate(run.settings)
    evolution = Evolution(tasks, settings, run.seed, run.steps, known_starts(settings))
    curve = _take_up(evolution, folder)
    before, began = (curve[-1].seconds if curve else 0.0), perf_counter()
    while evolution.rounds < run.steps:
        evolution.generation()
        if evolution.due() or evolution.rounds >= run.steps:
            score = evolution.validate()
            seconds = before + perf_counter() - began
            curve.append(Point(evolution.rounds, seconds, float(score.mean), float(score.half)))
            _save(evolution, curve, folder)
        on_report(Report(min(evolution.rounds, run.steps), curve))
    return finish(run, tasks[0], evolution.network, curve, evolution.rounds), curve


def _save(evolution: Evolution, curve: list[Point], folder: RunFolder) -> None:
    assert evolution.best is not None  # it has just been validated
    files = {"scores": np.stack(evolution.scores).tobytes(), "best": evolution.best.weights.tobytes()}
    notes = {"best": evolution.best.score, "curve": [list(point) for point in curve]}
    folder.save(Checkpoint(evolution.rounds, files, notes))


def _take_up(evolution: Evolution, folder: RunFolder) -> list[Point]:
    """Continue from the last checkpoint, if there is one, and return the learning curve so far."""
    last = folder.last()
    if last is None:
        return []
    for scores in np.frombuffer(last.files["scores"]).reshape(-1, evolution.settings.population):
        evolution.generation(scores)
    evolution.best = Validated(np.frombuffer(last.files["best"]), last.notes["best"])
    evolution.rounds = last.steps
    return [Point(*row) for row in last.notes["curve"]]
