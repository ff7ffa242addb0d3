"""A small run, the report on it, and the numbers of both."""

import json
import sqlite3
from pathlib import Path

import large_run
import numpy as np
from command_line import run
from csv_files import csv_rows
from small_suites import small

from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.store import ResultStore

SHOWN = ("heatmap", "curves", "breakdown", "tradeoff", "learners")
SUITE = small(models=["mean", "role-trust", "constant"], description="<script>alert(1)</script>")


def write_report(here: Path) -> None:
    """Write a run of three models, one of learners whose numbers are drawn, and the report on
    both."""
    with ResultStore(here / "results.sqlite", SUITE) as store:
        for cell in SUITE.cells():
            store.add(cell, play_cell(SUITE, cell))
    with ResultStore(here / "learners.sqlite", large_run.learners()) as store:
        for trial, done in large_run.stored_trials(large_run.learners()):
            store.add(trial, done)
    made = run(
        "report",
        *(str(here / f"{name}.sqlite") for name in ("results", "learners")),
        "--out",
        str(here / "out"),
    )
    assert made.exit_code == 0, made.output


def mean(
    folder: Path, model: str, attack: str, track: str, share: float, name: str = "utility"
) -> float:
    """Of what was measured, read from the file of the run by itself."""
    file = sqlite3.connect(folder / "results.sqlite")
    ((found,),) = file.execute(
        "SELECT measured FROM attacks JOIN cells ON attacks.cell = key WHERE cells.cell ->> "
        "'model' = ? "
        "AND attack = ? AND cells.cell ->> 'track' = ? AND cells.cell ->> 'share' = ?",
        (model, attack, track, share),
    )
    file.close()
    return float(np.mean([x for x in json.loads(found)[name] if x is not None]))


def lines(folder: Path, name: str) -> list[dict[str, str]]:
    return csv_rows(folder / "out" / f"{name}.csv")
