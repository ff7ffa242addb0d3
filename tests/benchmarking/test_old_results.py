"""Results files that were written before the benchmark moved into the library can still be read."""

import sqlite3
from pathlib import Path

import pytest

from roletrust_env.benchmarking import Leaderboard
from roletrust_env.benchmarking.store import Store

DUMP = Path(__file__).with_name("results-format-2.sql")


def test_results_of_format_2_have_the_same_leaderboard(tmp_path: Path) -> None:
    file = sqlite3.connect(tmp_path / "results.sqlite")
    file.executescript(DUMP.read_text(encoding="utf-8"))
    file.close()
    with Store(tmp_path / "results.sqlite") as store:
        leaderboard = Leaderboard.of(store.suite, store.all())
    first, second = leaderboard.rows
    assert (first.model, second.model) == ("mean", "role-trust")
    assert (first.worst.mean, second.worst.mean) == pytest.approx((0.9458, 0.9319), abs=1e-3)
    assert (first.worst_attack, second.worst_attack) == ("bad-mouthing", "bad-mouthing")
    assert leaderboard.caveats == []
