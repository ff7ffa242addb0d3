"""Scores of a world: each is a row of one table."""

import numpy as np
import pytest
from small_suites import tiny

from roletrust_env.benchmarking.entries import Entry
from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.run import InProcess, play_suite
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.evaluation.received import RANGES, SCORES, Score


def test_a_score_is_one_row(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    """It is in results, leaderboards and entries, also one that is another score once more."""
    brier = SCORES["brier"]
    rows = (
        Score("again", 0.0, 1.0, "lower", brier.formula, brier.part, brier.whole),
        Score("got", 0.0, 1.0, "higher", "mean", lambda one: one.got.mean(-1), lambda one: 1.0),
        Score("never", 0.0, 1.0, "higher", "nothing", lambda one: None, lambda one: 1.0),
    )
    for row in rows:
        monkeypatch.setitem(SCORES, row.name, row)
        monkeypatch.setitem(RANGES, row.name, (row.low, row.high))
    suite = tiny(methods=["scripts"], models=["mean"])
    stored = play_suite(suite, InProcess(), out=tmp_path)
    for case in Leaderboard.of(suite, stored).worst_cases.values():
        assert case.scores["again"] == pytest.approx(case.scores["brier"])
        assert ((case.scores["got"] > 0) & (case.scores["got"] <= 1)).all()
        assert np.isnan(case.scores["never"]).all()
    with ResultStore(tmp_path / "results.sqlite") as store:
        entry = Entry.of(store, "mean")
    measured = [attack.measured for cell in entry.cells for attack in cell.attacks]
    assert all({"again", "got", "never"} <= scores.keys() for scores in measured if scores)


def test_a_run_that_was_stored_before_a_score_opens(
    monkeypatch: pytest.MonkeyPatch, tmp_path
) -> None:
    suite = tiny(methods=["scripts"], models=["mean"])
    play_suite(suite, InProcess(), out=tmp_path)
    brier = SCORES["brier"]._replace(name="later")
    monkeypatch.setitem(SCORES, "later", brier)
    monkeypatch.setitem(RANGES, "later", (0.0, 1.0))
    board = Leaderboard.read(tmp_path / "results.sqlite")
    for case in board.worst_cases.values():
        assert np.isnan(case.scores["later"]).all()
        assert not np.isnan(case.scores["brier"]).any()
