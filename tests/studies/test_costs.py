import csv
from functools import partial
from math import inf

import pytest
from study_line import app
from typer.testing import CliRunner

from roletrust_env.trust import trust_models
from studies import costs as costs_module
from studies.timing import models as timing_models
from studies.timing.models import Limits, measure_models

pytestmark = pytest.mark.slow


def run(*arguments):
    return CliRunner().invoke(app, ["costs", "--side", "2", "--side", "3", *arguments], env={"COLUMNS": "400"})


@pytest.fixture(autouse=True)
def quickly(monkeypatch):
    """Short turns, and no size left out but with these limits."""

    def limited(**limits):
        monkeypatch.setattr(costs_module, "LIMITS", Limits(**limits))
        monkeypatch.setattr(costs_module, "measure_models", partial(measure_models, repeats=1, slice_s=1e-9))

    limited(seconds=inf, memory=inf)
    return limited


def test_every_model_has_its_row_and_its_cells(tmp_path):
    result = run("--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    with (tmp_path / "model-costs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["model"] for row in rows} == set(trust_models())
    assert len(rows) == 4 * len(trust_models())
    for row in rows:
        assert row["library"] == "NumPy"
        assert 0 < float(row["ns_per_rating_least"]) <= float(row["ns_per_rating"])
        assert not row["left_out"]
    page = (tmp_path / "model-costs.md").read_text()
    for name in trust_models():
        assert f"| {name} |" in page
        assert name in result.output
    assert "| clustering | S^2 P + S^3 log S |" in page
    assert {line.count("|") for line in page.splitlines() if line.startswith("|")} == {7}


def test_models_may_be_chosen_with_their_parameters(tmp_path):
    assert run("--model", "mean:lam=0.9", "--out", str(tmp_path)).exit_code == 0
    assert (tmp_path / "model-costs.csv").read_text().count("mean:lam=0.9") == 4
    assert "role-trust" not in (tmp_path / "model-costs.md").read_text()


def test_what_is_left_out_is_named_with_its_reason(tmp_path, quickly):
    quickly(memory=0)
    result = run("--model", "mean", "--out", str(tmp_path))
    assert "left out: mean on NumPy, 3 x 3: an update would take about" in result.output
    assert "- Left out: mean on NumPy, 3 x 3" in (tmp_path / "model-costs.md").read_text()
    assert "an update would take" in (tmp_path / "model-costs.csv").read_text().splitlines()[-1]


def test_what_is_not_compiled_in_time_is_left_out(tmp_path, monkeypatch):
    seen = {}

    def compile_ahead(work, jobs, limit_s, threads, advance):
        seen.update(limit_s=limit_s, threads=threads)
        for cell in jobs:
            advance(cell)
        return dict.fromkeys(jobs, "it is late")

    monkeypatch.setattr(timing_models, "compile_ahead", compile_ahead)
    options = "--compiled", "--compile-limit", "90", "--threads", "2", "--out", str(tmp_path)
    assert run("--model", "mean", *options).exit_code == 0
    assert seen == {"limit_s": 90, "threads": 2}
    page = (tmp_path / "model-costs.md").read_text()
    assert "| mean | S P | - | - |" in page
    assert "- Left out: mean on compiled torch, 2 x 2: it is late." in page
    with (tmp_path / "model-costs.csv").open() as file:
        late = [row for row in csv.DictReader(file) if row["library"] == "compiled torch"]
    assert [row["ns_per_rating"] for row in late] == ["", ""]
    assert all(row["left_out"] == "it is late" for row in late)


def test_one_size_does_not_show_growth():
    result = CliRunner().invoke(app, ["costs", "--side", "3"])
    assert result.exit_code == 2
    assert "growth needs at least two" in result.output + result.stderr
