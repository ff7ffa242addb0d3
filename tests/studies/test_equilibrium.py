"""`python -m studies.equilibrium`: its table, its files, and what it refuses."""

import csv

import pytest

pytest.importorskip("cma")

from small_suites import MARKET, small
from study_line import app
from typer.testing import CliRunner

from roletrust_env.benchmarking import benchmark

pytestmark = pytest.mark.slow


def equilibrium(*arguments):
    result = CliRunner().invoke(app, ["equilibrium", *map(str, arguments)])
    return result.exit_code, " ".join(result.output.split())


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    out = tmp_path_factory.mktemp("run")
    benchmark(suite=small(scenarios={"market": MARKET}, models=["mean", "median", "constant"]), out=out, workers=0)
    return out / "results.sqlite"


def test_the_equilibrium_is_shown_and_written(results, tmp_path):
    code, printed = equilibrium(results, "--resamples", 20, "--out", tmp_path)
    assert code == 0, printed
    assert "best mixture: " in printed
    with (tmp_path / "equilibrium.csv").open() as file:
        rows = {row["model"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"mean", "median", "constant"}
    assert sum(float(row["weight"]) for row in rows.values()) == pytest.approx(1)
    assert sum(float(row["alpha_rank"]) for row in rows.values()) == pytest.approx(1, abs=1e-5)
    page = (tmp_path / "equilibrium.md").read_text()
    assert page.startswith("| model | weight | alone | exploitability | alpha-rank |")
    assert f"Made by `python -m studies.equilibrium {results} --resamples 20 --seed 0`." in page
    assert (tmp_path / "equilibrium.png").stat().st_size > 1000
    with (tmp_path / "attacks.csv").open() as file:
        assert sum(float(row["weight"]) for row in csv.DictReader(file)) >= 1


def test_some_models_play_by_themselves(results, tmp_path):
    code, _ = equilibrium(results, "--model", "mean", "--resamples", 20, "--out", tmp_path)
    assert code == 0
    assert "| `mean` | 1.000 (1.000, 1.000) |" in (tmp_path / "equilibrium.md").read_text()


def test_what_is_not_there_is_refused(results, tmp_path):
    code, printed = equilibrium(results, "--model", "beta", "--out", tmp_path / "none")
    assert (code, "has no model 'beta'; it has mean, median, constant" in printed) == (2, True)
    assert not (tmp_path / "none").exists()
    code, printed = equilibrium(tmp_path / "none.sqlite")
    assert (code, "none.sqlite" in printed) == (2, True)
