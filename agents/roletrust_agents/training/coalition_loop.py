"""Training of a coalition, with checkpoints from which it continues to the last bit."""

from time import perf_counter
from typing import Any

import numpy as np

from roletrust_agents.learned.saved import SavedAttacker, tasks_from_card
from roletrust_agents.training.coalition_ppo import CoalitionPpoTraining
from roletrust_agents.training.coalition_training import CoalitionTraining, Validated
from roletrust_agents.training.evolution import Evolution
from roletrust_agents.training.evolution_strategy import EvolutionStrategy
from roletrust_agents.training.runs import (
    Checkpoint,
    CurvePoint,
    OnReport,
    Run,
    RunFolder,
    TrainingReport,
    finish,
    interruptible,
)
from roletrust_agents.training.settings import (
    CoalitionPPOSettings,
    CoalitionSettings,
    EvolutionSettings,
    StrategySettings,
    make_settings,
)
from roletrust_agents.training.universal import known_starts
from roletrust_env.evaluation.measurement import check_games_memory
from roletrust_env.game.make_task import Observation

_KINDS: dict[type[CoalitionSettings], type[CoalitionTraining[Any]]] = {
    EvolutionSettings: Evolution,
    StrategySettings: EvolutionStrategy,
    CoalitionPPOSettings: CoalitionPpoTraining,
}


def train(
    run: Run, folder: RunFolder, on_report: OnReport
) -> tuple[SavedAttacker, list[CurvePoint]]:
    """Train from the folder's last checkpoint, or from the beginning, to the end or to Ctrl-C.

    Args:
        run: Run to train.
        folder: Folder for checkpoints.
        on_report: Called with the progress after every step.

    Returns:
        The coalition with the best score during training, measured again in new games, and the
        learning curve.
    """
    training = _training(run)
    curve = _take_up(training, folder)
    before, began = (curve[-1].seconds if curve else 0.0), perf_counter()
    with interruptible(curve):
        while not curve or training.rounds < run.steps:
            training.step()
            if training.due() or training.rounds >= run.steps:
                score = training.validate()
                seconds = before + perf_counter() - began
                curve.append(
                    CurvePoint(training.rounds, seconds, float(score.mean), float(score.half))
                )
                _save(training, curve, folder)
            on_report(TrainingReport(min(training.rounds, run.steps), run.steps, curve))
    tasks = tasks_from_card(run.task, run.trust_model, run.scenario)
    return finish(run, tasks, training.network, curve, training.rounds), curve


def check_games(run: Run) -> None:
    """Refuse a run whose games do not fit into the memory, see `check_games_memory`."""
    settings = _settings(run)
    for model in (run.trust_model, *run.further_models):
        for task in tasks_from_card(run.task, model, run.scenario):
            check_games_memory(task, max(settings.games, settings.validation))


def _settings(run: Run) -> CoalitionSettings:
    settings = make_settings(run.task.id, run.algo, run.settings)
    assert isinstance(settings, CoalitionSettings)  # others train no coalition
    return settings


def _training(run: Run) -> CoalitionTraining[Any]:
    """Return the training of a run at its beginning."""
    settings = _settings(run)
    if run.task.knowledge != "black_box":
        raise ValueError(
            f"knowledge is {run.task.knowledge!r}; a coalition has black_box knowledge"
        )
    of_ppo: Observation = "accounts" if settings.wide else "coalition"
    observation: Observation = of_ppo if isinstance(settings, CoalitionPPOSettings) else "agents"
    models = (run.trust_model, *run.further_models)
    tasks = [
        task
        for model in models
        for task in tasks_from_card(run.task, model, run.scenario, observation)
    ]
    return _KINDS[type(settings)](
        tasks, settings, run.seed, run.steps, known_starts(settings.start, wide=settings.wide)
    )


def _save(training: CoalitionTraining[Any], curve: list[CurvePoint], folder: RunFolder) -> None:
    assert training.best is not None  # it has just been validated
    files = {"state": training.state(), "best": training.best.weights.tobytes()}
    notes = {"best": training.best.score, "curve": [list(point) for point in curve]}
    folder.save(Checkpoint(training.rounds, files, notes))


def _take_up(training: CoalitionTraining[Any], folder: RunFolder) -> list[CurvePoint]:
    """Continue from the last checkpoint, if there is one, and return the learning curve so far."""
    with folder.restoring() as last:
        if last is None:
            return []
        training.restore(last.files["state"])
        training.best = Validated(np.frombuffer(last.files["best"]), last.notes["best"])
        training.rounds = last.steps
        return [CurvePoint(*row) for row in last.notes["curve"]]
