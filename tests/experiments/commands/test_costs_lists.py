"""`roletrust costs --ratings`: a round of every central model on lists of ratings."""

import csv
import importlib.util
from math import inf
from pathlib import Path

import pytest
from command_line import run

from roletrust_env.trust import make_trust_model
from roletrust_env.trust.central import Central
from roletrust_env.trust.edge_state import edge_model
from roletrust_experiments.timing import edge_costs
from roletrust_experiments.timing.edge_costs import measure_lists
from roletrust_experiments.timing.edges import PLAIN
from roletrust_experiments.timing.models import Limits

WAYS = {"edges", "fused"} if importlib.util.find_spec("numba") is not None else {"edges"}


def central(*names: str) -> dict[str, Central]:
    return {name: edge_model(make_trust_model(name)) for name in names}


def test_a_list_has_a_row_for_each_model_and_way(tmp_path: Path) -> None:
    result = run("costs", "--ratings", "300", "--model", "mean", "--model", "beta", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    with (tmp_path / "edge-costs.csv").open() as file:
        rows = list(csv.DictReader(file))
    wanted = {(PLAIN, "edges"), *((name, way) for name in ("mean", "beta") for way in WAYS)}
    assert {(row["model"], row["sums"]) for row in rows} == wanted
    for row in rows:
        assert 150 < int(row["ratings"]) <= int(row["ratings_asked"]) == 300
        assert 0 < float(row["ns_per_rating_least"]) <= float(row["ns_per_rating"])
        assert int(row["peak_bytes"]) > 4 * 8 * int(row["ratings"])  # the list alone
    page = (tmp_path / "edge-costs.md").read_text()
    assert "| beta | 300 | edges |" in page
    assert "GB/s" in page


def test_a_longer_list_is_left_out_by_what_the_shorter_one_took(monkeypatch: pytest.MonkeyPatch) -> None:
    for limits, reason in (
        (Limits(seconds=0, memory=inf), "a round would take about"),
        (Limits(seconds=inf, memory=0), "MB"),
    ):
        found = measure_lists(central("mean"), [200, 20], limits=limits, repeats=1, slice_s=1e-9)
        assert found["mean", "edges", 20].timing is not None
        assert found["mean", "edges", 200].timing is None
        assert reason in found["mean", "edges", 200].left_out
        assert found[PLAIN, "edges", 200].timing is not None


def test_without_numba_there_are_no_fused_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(edge_costs.importlib.util, "find_spec", lambda name: None)
    found = measure_lists(central("mean"), [20], repeats=1, slice_s=1e-9)
    assert {way for _, way, _ in found} == {"edges"}


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
