"""The leaderboard of a run with invented numbers."""

import csv
from pathlib import Path

import numpy as np
import pytest
from small_suites import small

from roletrust_env.benchmarking.leaderboard import HEADER, Leaderboard
from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.suite import Cell, Suite
from roletrust_env.evaluation.received import SCORES

SETTINGS = {
    "clean": {},
    "raters": {"roles": ["SR"], "share": 0.3},
    "coalition": {"roles": ["SR", "SP"], "share": 0.2},
}
WORST = {"own-experience": 0.5, "mean": 0.2, "block": 0.7, "solo-threshold": 0.5}
NOISE = np.array([-0.01, 0.0, 0.01])


def row(name: str, chosen: float, measured: float | None, **fields: object) -> AttackResult:
    scores = {score: [0.1, 0.1, 0.1] for score in SCORES}
    if measured is not None:
        scores["skill"] = (measured + NOISE).tolist()
    measured_scores = scores if measured is not None else {}
    return AttackResult(name, name, 0, {"skill": [chosen, chosen]}, measured_scores, **fields)  # type: ignore[arg-type]


def run() -> tuple[Suite, list[tuple[Cell, CellResult]]]:
    suite = small(settings=SETTINGS)
    stored = []
    for cell in suite.cells():
        worst, rows = WORST[cell.model], []
        if cell.method == "honest":
            rows = [row("honest", 0.9, 0.9)]
        elif cell.method == "scripts":
            rows = [row("honest", 0.9, None), row("bad-mouthing", worst + 0.1, worst + 0.1)]
        else:
            course = ((10, worst + 0.2), (20, worst + 0.005), (40, worst))
            rows = [
                row("search 1", worst, worst, progress=course),
                row("search 2", worst + 0.02, None, progress=course),
            ]
        stored.append((cell, CellResult(tuple(rows), 1.0)))
    return suite, stored


def test_ranks_tiers_and_gain() -> None:
    board = Leaderboard.of(*run())
    common = [line for line in board.rows if line.rule == "common"]
    assert [line.model for line in common] == ["block", "own-experience", "solo-threshold", "mean"]
    assert [line.rank for line in common] == [1, 2, 2, 4]
    assert [line.tier for line in common] == [1, 2, 2, 3]
    for line in common:
        assert line.estimates["worst"].mean == pytest.approx(WORST[line.model])
        assert line.estimates["gain"].mean == pytest.approx(WORST[line.model] - 0.5)
        assert line.estimates["clean"].mean == pytest.approx(0.9)
        assert line.worst_attack == "search 1"
    own = [line for line in board.rows if line.rule == "own"]
    assert [(line.model, line.rank) for line in own] == [("block", 1), ("solo-threshold", 2)]


def test_convergence_of_searches() -> None:
    board = Leaderboard.of(*run())
    for (_, _, setting), case in board.worst_cases.items():
        if setting == "clean":
            assert np.isnan([case.last_gain, case.disagreement]).all()
        else:
            assert case.last_gain == pytest.approx(0.005)
            assert case.disagreement == pytest.approx(0.02)


def test_failed_and_missing_cells_have_no_tier() -> None:
    suite, stored = run()
    cell, result = next(pair for pair in stored if pair[0].model == "block")
    stored.remove((cell, result))
    stored.append((cell, result._replace(failed="it broke", rows=())))
    other = next(pair for pair in stored if pair[0].model == "mean")
    stored.remove(other)
    board = Leaderboard.of(suite, stored)
    missing = {line.model: line.missing for line in board.rows if line.rule == "common"}
    assert missing == {"block": 1, "mean": 1, "own-experience": 0, "solo-threshold": 0}
    for line in board.rows:
        assert (line.tier is None) == (line.missing > 0)


def test_the_files_have_the_numbers(tmp_path: Path) -> None:
    board = Leaderboard.of(*run())
    board.to_csv(tmp_path / "leaderboard.csv")
    with (tmp_path / "leaderboard.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert tuple(lines[0]) == HEADER
    assert [float(line["worst"]) for line in lines] == [
        pytest.approx(each.estimates["worst"].mean) for each in board.rows
    ]
    board.cases_to_csv(tmp_path / "worst_cases.csv")
    with (tmp_path / "worst_cases.csv").open(newline="") as file:
        cases = list(csv.DictReader(file))
    assert len(cases) == len(board.worst_cases)
    assert {line["method"] for line in cases} == {"honest", "search"}
    frame = pytest.importorskip("pandas") and board.to_pandas()
    assert frame["model"].tolist() == [line["model"] for line in lines]
