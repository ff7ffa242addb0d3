"""`roletrust audit`: its files, its options, which are those of `rate`, and its exit code."""

import json
import sys
from pathlib import Path

import pytest
from command_line import run

from roletrust_baselines.logs.folders import write_log

SMALL = ["--same-agents", "--scale", "-10", "10", "--top", "2", "--targets", "1", "--budget", "6"]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = tmp_path_factory.mktemp("log") / "ratings.csv.gz"
    write_log(path, members=30, months=8)
    return path


def test_an_audit_says_the_same_on_screen_in_json_and_on_its_page(log: Path, tmp_path: Path):
    jsonschema = pytest.importorskip("jsonschema")
    prices = ["--price-account", "7", "--price-rating", "0.5", "--fail-below", "1000"]
    columns = ["--rater", "1", "--ratee", "2", "--rating", "3", "--time", "4"]
    result = run("audit", str(log), *SMALL, *prices, *columns, "--model", "mean", "--out", str(tmp_path))
    assert result.exit_code == 1, result.output
    assert "Failed: a median price is" in result.output
    found, page = json.loads((tmp_path / "audit.json").read_text()), (tmp_path / "audit.html").read_text()
    jsonschema.validate(found, json.loads((tmp_path / "audit.schema.json").read_text()))
    assert (found["format"], list(found["models"])) == ("roletrust-audit-1", ["mean"])
    first = found["models"]["mean"]["exposures"][0]["cheapest"]
    assert first["price"] == first["accounts"] * 7 + first["ratings"] * 0.5
    for text in ("out of top", "newcomer in", f"{first['price']:,.4g}"):
        assert text in result.output
        assert text in page
    assert page.index("data:image/png") < page.index("<table>")
    assert max(map(len, result.output.splitlines()[1:-3])) <= 80


@pytest.mark.slow
def test_models_stand_beside_each_other_and_a_scorer_outside_is_audited_as_one_inside(log: Path, tmp_path: Path):
    arguments = ["audit", str(log), *SMALL, "--fail-below", "0.5", "--out", str(tmp_path)]
    outside = f"exec:{sys.executable} -c 'from roletrust_experiments import main; main()' serve mean"
    result = run(*arguments, "--scorer", "mean", "--other", outside)
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "audit.json").read_text())
    inside, same = found["models"].values()
    assert inside == same
    assert set(found["forecasts"][outside]) >= {"r", "auc"}
    assert "Median price, and forecast" in result.output
