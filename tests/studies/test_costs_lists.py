"""`python -m studies.costs --ratings`: a round of every central model on lists of ratings."""

import csv
from math import inf
from pathlib import Path

import pytest
from study_line import run

from roletrust_env.trust import TrustModel, make_trust_model
from roletrust_env.trust.edge_state import edge_model
from studies.timing import edge_costs
from studies.timing.edge_costs import measure_lists
from studies.timing.edges import PLAIN
from studies.timing.models import Limits

pytestmark = pytest.mark.slow


def central(*names: str) -> dict[str, TrustModel]:
    return {name: edge_model(make_trust_model(name)) for name in names}


def test_a_list_has_a_row_for_each_model(tmp_path: Path) -> None:
    result = run("costs", "--ratings", "300", "--model", "mean", "--model", "beta", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    with (tmp_path / "edge-costs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["model"] for row in rows] == [PLAIN, "mean", "beta"]
    for row in rows:
        assert 150 < int(row["ratings"]) <= int(row["ratings_asked"]) == 300
        assert 0 < float(row["ns_per_rating_least"]) <= float(row["ns_per_rating"])
        assert int(row["peak_bytes"]) > 4 * 8 * int(row["ratings"])  # the list alone
    page = (tmp_path / "edge-costs.md").read_text()
    assert "## 300 ratings" in page
    assert {line.split(" | ")[0] for line in page.splitlines() if line.startswith("| ")} >= {"| mean", "| beta"}
    assert {line.count("|") for line in page.splitlines() if line.startswith("| ")} == {5}
    assert "GB/s" in page


def test_a_longer_list_is_left_out_by_what_the_shorter_one_took(monkeypatch: pytest.MonkeyPatch) -> None:
    for limits, reason in (
        (Limits(seconds=0, memory=inf), "a round would take about"),
        (Limits(seconds=inf, memory=200 * edge_costs.BYTES), "MB"),
    ):
        found = measure_lists(central("mean"), [200, 20], limits=limits, repeats=1, slice_s=1e-9)
        assert found["mean", 20].timing is not None
        assert found["mean", 200].timing is None
        assert reason in found["mean", 200].left_out
        assert found[PLAIN, 200].timing is not None


def test_a_list_that_does_not_fit_is_refused_before_it_is_drawn(tmp_path: Path) -> None:
    result = run("costs", "--ratings", "300", "--ratings", "999999999999", "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    wanted = (
        "a list of 999,999,999,999 ratings would take about 100 TB of memory, and 8 GB are allowed, 80,000,000 ratings"
    )
    assert wanted in " ".join(result.output.replace("│", " ").split())
    assert not (tmp_path / "out").exists()


def test_a_rating_takes_the_memory_that_is_assumed() -> None:
    cell = measure_lists({}, [100_000], repeats=1, slice_s=1e-9)[PLAIN, 100_000]
    assert 0.8 < cell.memory / (100_000 * edge_costs.BYTES) < 1.2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--side", "3"], "--ratings is measured without --side and --compiled"),
        (["--compiled"], "--ratings is measured without --side and --compiled"),
        (["--model", "travos"], "does not run on edges"),
    ],
)
def test_what_does_not_go_together_is_one_line(options: list[str], message: str) -> None:
    result = run("costs", "--ratings", "300", *options)
    assert result.exit_code == 2
    assert message in " ".join(result.output.split())
