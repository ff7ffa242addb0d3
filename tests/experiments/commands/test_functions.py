"""Each command writes the numbers of the function that it calls."""

import json
from pathlib import Path

import pytest
from command_line import printed, setting
from csv_files import csv_rows

from roletrust_env.benchmarking import benchmark, benchmark_learners, load_suite
from roletrust_env.logs import audit, compare, rate, read, write_log
from roletrust_env.logs.compare import MONTH

SCALE = ["--scale", "-10", "10", *setting(same_agents="true")]
SUITE = """
extends = "quick"
models = ["mean"]
own = []
attacks = ["bad-mouthing"]
methods = ["scripts"]
games = 1
selection_games = 1
[settings.clean]
[settings.raters]
roles = ["SR"]
share = 0.3
"""
LEARNERS = """
kind = "learners"
learners = ["random search"]
budgets = [2000]
games = 2
seeds = [0]
[tasks.provider]
task = "ProviderAttack"
set = { max_cycles = 12, noise = 0.0, perturbations = [] }
"""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "log.csv.gz"
    write_log(path)
    return path


def test_rate(log: Path, tmp_path: Path) -> None:
    printed("rate", log, *SCALE, "--model", "mean", "--out", tmp_path)
    rated = rate(log, scale=(-10, 10), same_agents=True, model="mean")
    for role, table in (("ratees", rated.ratees), ("raters", rated.raters)):
        written = csv_rows(tmp_path / f"{role}.csv")
        assert [row["name"] for row in written] == table["name"].tolist()
        trust = [float(row["trust"]) for row in written]
        assert trust == pytest.approx(table["trust"].tolist(), abs=1e-6)


def test_compare(log: Path, tmp_path: Path) -> None:
    models = ["mean", "beta"]
    options = [word for name in models for word in ("--model", name)]
    shown = printed("compare", log, *SCALE, *options, "--out", tmp_path)
    found = compare(read(log, scale=(-10, 10), same_agents=True), models)
    written = csv_rows(tmp_path / "comparison.csv")
    assert [(row["model"], row["measure"]) for row in written] == [
        (row.model, row.measure) for row in found.rows
    ]
    assert [row["value"] for row in written if row["value"]] == [
        f"{row.value:.6f}" for row in found.rows if row.value == row.value
    ]
    assert f"{found.recommended} is recommended" in shown


def test_audit(log: Path, tmp_path: Path) -> None:
    printed("audit", log, *SCALE, "--model", "mean", "--top", "3", "--out", tmp_path)
    written = json.loads((tmp_path / "audit.json").read_text())
    members = read(log, scale=(-10, 10), same_agents=True)
    found = audit(members, model="mean", every=MONTH, top=3, name=log.name)
    assert written == json.loads(found.json())
    for goal, median in found.medians.items():
        assert f"| {goal} | {median.value:.4g} |" in repr(found)


def test_benchmark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_process: None) -> None:
    monkeypatch.chdir(tmp_path)
    Path("tiny.toml").write_text(SUITE)
    shown = printed("benchmark", "all", "--suite", "tiny.toml", "--out", "out")
    board = benchmark("all", "tiny.toml", workers=0, progress=False)
    board.to_csv("function.csv")
    assert Path("function.csv").read_bytes() == Path("out/leaderboard.csv").read_bytes()
    assert " ".join(repr(board).split()) in shown


def test_benchmark_learners(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_process: None
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("tiny.toml").write_text(LEARNERS)
    printed("benchmark", "--suite", "tiny.toml", "--out", "out")
    board = benchmark_learners(suite=load_suite("tiny.toml"), workers=0, progress=False)
    board.write("function")
    written = Path("out/learners.csv").read_bytes()
    assert Path("function/learners.csv").read_bytes() == written
    (row,) = board.table()[1]
    assert row[1] == "random search"
    assert row[2] in board._repr_markdown_()
