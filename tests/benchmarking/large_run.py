"""Large run with random numbers in place of games, for tests of reports.

It has every trust model and two variants, the scripted attacks and the searches, and six conditions
in each of two scenarios.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from small_suites import MARKET

from roletrust_env.benchmarking.learners.learner import HONEST_PLAY
from roletrust_env.benchmarking.learners.suite import LearnersSuite, Trial
from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import HONEST, Cell, Suite
from roletrust_env.benchmarking.suite_files import read_suite
from roletrust_env.trust.model import registry

BLIND = 0.65
ROUNDS, GAMES = 60, 3


def large(**fields: Any) -> Suite:
    """Return a suite with all registered models and two more, some thirty attacks and twelve
    conditions."""
    return read_suite(
        {
            "name": "large",
            "description": "Random numbers",
            "models": [*registry.names(), "trimmed-mean:share=0.3", "huber-mean:width=0.2"],
            "scenarios": {"market": MARKET, "crowd": {"preset": "crowd-10x10"}},
            "tracks": {
                "honest": {},
                "perturbed": {
                    "set": {"perturbations": [{"start": 20, "stop": 24, "strength": 1.0}]}
                },
                "raters": {"roles": ["SR"], "shares": [0.1, 0.3, 0.5]},
                "coalition": {"roles": ["SR", "SP"], "shares": [0.3]},
            },
            "games": GAMES,
        }
        | fields,
        "large",
    )


def stored_cells(suite: Suite) -> list[StoredCell]:
    """Return the cells of a suite with random results."""
    scripts, stored = suite.attack_names, []
    for cell in suite.cells():
        names = scripts if cell.method == "scripted" else [cell.method]
        rows = tuple(
            _row(suite.models, [HONEST, *scripts, *suite.methods[1:]], cell, name) for name in names
        )
        stored.append(StoredCell(cell, CellResult(rows, 1.0)))
    return stored


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


def _row(names: Sequence[str], attacks: Sequence[str], cell: Cell, attack: str) -> AttackResult:
    """Return a random result. The loss grows with the attack and the share, and is lower for better
    models."""
    goodness, force = 1 - names.index(cell.model) / len(names), attacks.index(attack) / len(attacks)
    draw = np.random.default_rng(
        [names.index(cell.model), attacks.index(attack), len(cell.track), int(10 * cell.share)]
    )
    left = (
        0.97
        - 0.03 * (1 - goodness)
        - cell.share * force * (0.25 + 0.9 * (1 - goodness))
        + draw.normal(0, 0.02)
    )
    auc = np.clip(0.5 + 0.5 * goodness - 0.4 * draw.random(), 0, 1)

    def games() -> dict[str, list[Any]]:
        honest = cell.method == HONEST
        scores = {
            "utility": np.clip(draw.normal(left, 0.05, GAMES), 0, 1),
            "blind": draw.normal(BLIND, 0.02, GAMES),
            "damage": np.full(GAMES, np.nan)
            if honest
            else draw.normal((1 - left) / 2, 0.05, GAMES),
            "false_alarms": np.clip(draw.normal(0.1 * (1 - goodness), 0.03, GAMES), 0, 1),
            "auc": np.full(GAMES, np.nan)
            if honest
            else np.clip(draw.normal(auc, 0.05, GAMES), 0, 1),
        }
        scores["published"] = scores["utility"]
        return {
            name: [None if np.isnan(x) else float(x) for x in values]
            for name, values in scores.items()
        }

    rounds = np.arange(2, ROUNDS + 1)
    curve = left + (BLIND - left) * np.exp(-rounds / 5) + draw.normal(0, 0.01, len(rounds))
    return AttackResult(attack, attack, 0, games(), games(), [float(x) for x in curve])


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
