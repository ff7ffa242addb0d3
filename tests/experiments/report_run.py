"""Small runs of the closed loop, the report on one, and their numbers."""

from collections.abc import Sequence
from pathlib import Path

import large_run
import numpy as np
from command_line import run
from csv_files import csv_rows
from small_suites import small

from roletrust_env.benchmarking.run import InProcess, play_suite
from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.store import ResultStore, StoredCell
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.evaluation.agreed import AgreedScripts
from roletrust_env.evaluation.attackers import record_of
from roletrust_env.evaluation.received import SCORES

SHOWN = ("leaderboard", "worst_cases", "curves", "learners")
SETTINGS = ("clean", "raters", "raters-open", "coalition")


def small_suite(**fields: object) -> Suite:
    """Return a small suite with few settings and attacks, and worlds of another seed."""
    base = small()
    usual = {
        "games": 3,
        "worlds": {
            **{**base.worlds.model_dump(), "selection": 1, "seed": 4},
            "set": {**base.worlds.set, "continuation": 1.0},
        },
        "settings": {name: base.settings[name].model_dump() for name in SETTINGS},
        "attacks": ["bad-mouthing", "rank-lies", "on-off", "milking-ring"],
        "methods": ["scripts"],
    }
    return small(**{**usual, **fields})


SUITE = small_suite(description="<script>alert(1)</script>")


def write_run(path: Path, suite: Suite, stored: Sequence[StoredCell]) -> Path:
    """Write the file of a run."""
    with ResultStore(path, suite) as store:
        for cell, result in stored:
            store.add(cell, result)
    return path


def played(suite: Suite) -> list[StoredCell]:
    """Play a suite, and return its cells."""
    return play_suite(suite, InProcess())


def random_cells(suite: Suite, record: str = "") -> list[StoredCell]:
    """Return the cells of a suite with one attack and random numbers each, in place of games."""
    draw, worlds = np.random.default_rng(0), suite.worlds.measured
    record = record or record_of(AgreedScripts())
    stored = []
    for cell in suite.cells():
        scores = {name: draw.random(worlds).tolist() for name in SCORES}
        chosen = {"skill": draw.random(suite.worlds.selection).tolist()}
        rounds = draw.random(60).tolist()
        row = AttackResult(suite.attacks[0], "words", 0, chosen, scores, rounds, record=record)
        stored.append(StoredCell(cell, CellResult((row,), 1.0)))
    return stored


def write_report(here: Path) -> None:
    """Write a run of the small suite, one of learners whose numbers are drawn, and the report on
    both."""
    write_run(here / "results.sqlite", SUITE, played(SUITE))
    with ResultStore(here / "learners.sqlite", large_run.learners()) as store:
        for trial, done in large_run.stored_trials(large_run.learners()):
            store.add(trial, done)
    files = (here / f"{name}.sqlite" for name in ("results", "learners"))
    made = run("report", *files, "--out", here / "out")
    assert made.exit_code == 0, made.output


def lines(folder: Path, name: str) -> list[dict[str, str]]:
    """Return the rows of a table of a report."""
    return csv_rows(folder / "out" / f"{name}.csv")
