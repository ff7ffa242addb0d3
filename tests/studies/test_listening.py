"""The study of what listening is worth: its numbers by hand, a small run, and what is published."""

import math
from pathlib import Path

import pytest
from csv_files import csv_rows

from studies import listening
from studies.listening import LIARS, MODELS, RIDDEN, SILENT, SOLO, break_even, gain, silent_row
from studies.study import run

PUBLISHED = Path(__file__).parents[2] / "docs" / "listening"


@pytest.mark.parametrize(
    ("gains", "share"),
    [
        ([0.2, 0.1, -0.1], 0.3),
        ([0.2, -0.2, 0.1], 0.1),
        ([0.0, -0.1, -0.2], 0.0),
        ([-0.1, 0.2, 0.2], 0.0),
        ([0.2, 0.1, 0.0], math.nan),
    ],
)
def test_the_break_even_share_is_interpolated(gains: list[float], share: float) -> None:
    assert break_even(gains, (0.0, 0.2, 0.4)) == pytest.approx(share, nan_ok=True)


def test_gain_and_advantage_by_hand() -> None:
    """A quarter of the consumers is silent; the others have the skills 0.5 and 0.7."""
    quiet = [0.25, 0.25]
    runs = {
        "block silent-20": {
            "skill": [0.25 * 0.9 + 0.75 * 0.5, 0.25 * 0.9 + 0.75 * 0.7],
            "silent_skill": [0.9, 0.9],
            "quiet": quiet,
        },
        f"{SOLO} silent-20": {"skill": [0.3, 0.4], "silent_skill": [0.3, 0.4], "quiet": quiet},
    }
    everyone, more, alone, advantage = silent_row(runs, "block", 0.2)
    assert everyone.mean == pytest.approx(0.675)
    assert more == gain(runs, "block", "silent-20")
    assert more.mean == pytest.approx(0.325)
    assert alone.mean == pytest.approx(0.9)
    assert advantage.mean == pytest.approx(0.3)


def test_a_small_study_writes_its_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listening, "MODELS", (SOLO, "block", "beta"))
    monkeypatch.setattr(listening, "RIDDEN", (SOLO, "block"))
    monkeypatch.setattr(listening, "LIARS", (0.0, 0.45))
    monkeypatch.setattr(listening, "SILENT", (0.0, 0.4, 1.0))
    size = "--selection 1 --measured 2 --games 1 --selection-games 1 --workers 1"
    run("studies.listening", [*size.split(), "--out", str(tmp_path)])
    rows = {(row["model"], float(row["share"])): row for row in csv_rows(tmp_path / "liars.csv")}
    assert len(rows) == 3 * 2
    assert float(rows[SOLO, 0.45]["gain"]) == 0
    assert float(rows["beta", 0.45]["gain"]) < -0.2 < float(rows["beta", 0.0]["gain"])
    silent = {(row["model"], float(row["share"])): row for row in csv_rows(tmp_path / "silent.csv")}
    # Without any report, block is the solo model.
    assert float(silent["block", 1.0]["gain"]) == pytest.approx(0, abs=1e-6)
    assert float(silent["block", 0.4]["gain"]) > 0
    assert (tmp_path / "listening.png").stat().st_size > 0


def test_published_tables_are_of_this_study() -> None:
    liars = csv_rows(PUBLISHED / "liars.csv")
    assert [(row["model"], float(row["share"])) for row in liars] == [
        (model, share) for model in MODELS for share in LIARS
    ]
    silent = csv_rows(PUBLISHED / "silent.csv")
    assert [(row["model"], float(row["share"])) for row in silent] == [
        (model, share) for model in RIDDEN for share in SILENT
    ]
    for row in csv_rows(PUBLISHED / "break_even.csv"):
        gains = [float(liar["gain"]) for liar in liars if liar["model"] == row["model"]]
        share = float(row["share"]) if row["share"] else math.nan
        assert share == pytest.approx(break_even(gains, LIARS), abs=1e-4, nan_ok=True)
