"""Reruns of a benchmark: runs of a few seeds are what they are alone, and promises are counted by hand."""

from types import SimpleNamespace

import pytest
from small_suites import MARKET, small

from roletrust_env.benchmarking import benchmark
from roletrust_env.metrics.confidence import Estimate
from studies.reruns import main, promises, reruns

pytestmark = pytest.mark.slow


def row(model, rank, mean, half, holds):
    return SimpleNamespace(model=model, rank=rank, worst=Estimate(mean, half), holds=holds)


def test_promises_are_counted_in_every_pair_of_runs():
    boards = [
        [row("a", 1, 0.9, 0.03, 0.9), row("b", 2, 0.5, 0.03, 0.9)],
        [row("a", 1, 0.9, 0.03, 0.5), row("b", 2, 0.54, 0.03, 0.5)],
        [row("b", 1, 0.55, 0.03, 0.1), row("a", 2, 0.5, 0.03, 0.1)],
    ]
    means, *ranks, everything = promises(boards)
    assert (means.promised, means.cases) == (0.95, 12)
    assert means.kept == pytest.approx(6 / 12)  # a: one pair of three; b: 0.04 and 0.01 are within 0.042, 0.05 is not
    assert [(one.promised, one.kept, one.cases) for one in ranks] == [(0.1, 0.0, 4), (0.5, 0.5, 4), (0.9, 0.5, 4)]
    assert everything == ("ranks are the same, all", pytest.approx(0.5), pytest.approx(1 / 3), 12)


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    suite = small(scenarios={"market": MARKET}, models=["mean", "median"], methods=["scripted"], seeds=[4, 5, 6, 7, 8])
    return suite, benchmark(suite=suite, out=tmp_path_factory.mktemp("reruns"), workers=0)


def test_a_run_is_what_it_is_alone(played, tmp_path):
    suite, found = played
    boards = reruns(suite, found.cells, 2)
    assert len(boards) == 2  # the fifth seed is left over
    alone = benchmark(suite=suite.model_copy(update={"seeds": (6, 7)}), out=tmp_path, workers=0)
    assert [str(row) for row in boards[1]] == [str(row) for row in alone.rows]


def test_the_study_continues(tmp_path, monkeypatch):
    suite = small(models=["mean", "median"], name="whole", seeds=[1, 2])
    monkeypatch.setattr("studies.reruns.suite_of", lambda name: suite)
    options = ["--suite", "whole", "--seeds", "1", "--workers", "1", "--out", str(tmp_path)]
    main(options)
    page = (tmp_path / "reruns.md").read_text()
    assert "| means are within the interval of their difference | 0.95 | " in page
    monkeypatch.setattr("roletrust_env.benchmarking.cells.play_cell", None)
    main(options)
    assert (tmp_path / "reruns.md").read_text() == page
