"""The study of what Sybils gain: its numbers in a small community, and what is published."""

from pathlib import Path

import numpy as np
import pytest
from csv_files import csv_rows

from roletrust_env.metrics.confidence import Estimate
from studies.study import run
from studies.sybil_graphs import SybilGraph
from studies.sybils import (
    BRIDGES,
    CASES,
    MODELS,
    PERSONAL,
    SYBILS,
    TOPOLOGIES,
    Options,
    community,
    gains,
    measured,
    worst,
)

DOCS = Path(__file__).parents[2] / "docs"


def test_a_community_has_many_good_members_some_cheats_and_returned_ratings() -> None:
    log = community(200, np.random.default_rng(0))
    pairs = set(zip(log.raters.tolist(), log.ratees.tolist(), strict=True))
    assert len(pairs) == len(log.raters)
    assert np.mean([(j, i) in pairs for i, j in pairs]) == pytest.approx(2 * 0.8 / 1.8, abs=0.03)
    assert np.mean(log.values < 0.5) == pytest.approx(0.1, abs=0.06)


def test_gains_by_hand() -> None:
    """Of 20 members 2 are seeds; without bridge edges nobody reaches the attacker, and with them it
    has a share."""
    log = community(20, np.random.default_rng(0))
    for model in MODELS[2:]:
        assert gains(model, SybilGraph("cycle", 5), log, 2)["share"] == 0
        assert (
            0 < gains(model, SybilGraph("cycle", 5, returned=True), log, 2, [3, 4])["share"] < 0.5
        )
        alone, sold = (
            gains(model, SybilGraph("line", n, returned=True), log, 2, bought=7)["share"]
            for n in (0, 5)
        )
        assert 0 < alone < 0.5
        assert sold > 0
    for model in ("eigentrust", PERSONAL):
        assert gains(model, SybilGraph("cycle", 50), log, 2)["share"] > 0.5


def test_the_worst_topology_is_the_one_with_the_highest_mean() -> None:
    found = {f"m {name} 3 2": {"share": Estimate(k % 3, 0.1)} for k, name in enumerate(TOPOLOGIES)}
    assert worst(found, "m", 3, 2, "share") == (TOPOLOGIES[2], Estimate(2, 0.1))


@pytest.mark.slow
def test_the_study_writes_the_means_of_its_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(
        "studies.sybils",
        [
            "--members",
            "30",
            "--runs",
            "2",
            "--seeds",
            "2",
            "--workers",
            "1",
            "--out",
            str(tmp_path),
        ],
    )
    rows = csv_rows(tmp_path / "gains.csv")
    assert len(rows) == (len(MODELS) + 1) * len(TOPOLOGIES) * (len(CASES) + 1)
    options = Options(members=30, runs=2, seeds=2)
    runs = [measured(options, 0, k) for k in range(2)]
    for row in rows[::17]:
        key = " ".join(row[name] for name in ("model", "topology", "sybils", "bridges"))
        assert float(row["share"]) == pytest.approx(
            np.mean([run[key]["share"] for run in runs]), abs=1e-6
        )
    assert "Without a bridge edge" in capsys.readouterr().out


@pytest.mark.parametrize("folder", ["sybils", "sybils/log"])
def test_published_tables_are_of_this_study(folder: str) -> None:
    rows = csv_rows(DOCS / folder / "gains.csv")
    assert {row["model"] for row in rows} == {*MODELS, *([] if "log" in folder else [PERSONAL])}
    assert {int(row["sybils"]) for row in rows} == set(SYBILS)
    assert {row["bridges"] for row in rows} == {*map(str, BRIDGES), "bought"}
