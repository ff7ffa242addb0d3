"""The benchmark from Python: models as objects, files, progress, and the same numbers in every
pool."""

from pathlib import Path

import pytest
from benchmark_cases import results
from refusals import refuses
from small_suites import small

from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.run import play_suite
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.trust.models.central.means import Mean

SUITE = small(games=2, tracks={"honest": {}, "raters": {"roles": ["SR"], "shares": [0.5]}})
ATTACKS = ["bad-mouthing"]


class Mine(Mean):
    """Mean under another name."""


def test_an_object_a_class_and_a_name_share_a_rank() -> None:
    leaderboard = benchmark(
        [Mine(), Mine, "mean", "constant"], SUITE, attacks=ATTACKS, workers=0, progress=False
    )
    assert [(row.rank, row.model) for row in leaderboard.rows][:3] == [
        (1, "Mine"),
        (1, "Mine-2"),
        (1, "mean"),
    ]
    assert len({tuple(map(str, row[3:])) for row in leaderboard.rows[:3]}) == 1
    assert {row.tier for row in leaderboard.rows[:3]} == {1}
    assert leaderboard.rows[3].rank == 4
    assert leaderboard.rows[0].worst_attack == "bad-mouthing"
    assert "Mine" not in trust_models.names()


def test_processes_and_this_process_give_the_same_results(tmp_path: Path) -> None:
    suite = SUITE.model_copy(update={"methods": ("scripted", "random search"), "budget": 200})
    here = benchmark([Mine(), "mean"], suite, attacks=ATTACKS, workers=0, progress=False)
    there = benchmark(
        [Mine(), "mean"], suite, attacks=ATTACKS, workers=2, progress=False, out=tmp_path
    )
    assert results(here.cells) == results(there.cells)
    assert str(here.rows) == str(there.rows)  # NaN is not equal to itself
    assert (tmp_path / "results.sqlite").exists()


def test_a_run_continues_and_reports_the_stored_cells(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = benchmark(["mean"], SUITE, attacks=ATTACKS, workers=0, progress=False, out=tmp_path)
    started = []

    class NoPool:
        def play(self, suite, cells):
            assert not cells
            return
            yield

    play_suite(
        first.suite, NoPool(), out=tmp_path, on_start=lambda *numbers: started.append(numbers)
    )
    assert started == [([], len(first.cells))]
    benchmark(["mean"], SUITE, attacks=ATTACKS, workers=0, out=tmp_path)
    assert "Playing" in capsys.readouterr().err
    with refuses(ValueError, "results.sqlite", "models"):
        benchmark(["median"], SUITE, attacks=ATTACKS, workers=0, progress=False, out=tmp_path)


def test_a_leaderboard_has_several_forms(tmp_path: Path) -> None:
    leaderboard = benchmark("mean", SUITE, attacks=ATTACKS, workers=0, progress=False)
    assert "mean" in repr(leaderboard)
    assert "bad-mouthing" in repr(leaderboard)
    assert leaderboard.to_markdown().startswith("| tier | rank | model | clean |")
    assert leaderboard.to_markdown() in leaderboard._repr_markdown_()
    leaderboard.to_csv(tmp_path / "board.csv")
    assert (tmp_path / "board.csv").read_text().startswith("tier,rank,model,clean")
    pandas = pytest.importorskip("pandas")
    assert isinstance(leaderboard.to_pandas(), pandas.DataFrame)
    assert leaderboard.to_pandas()["model"].tolist() == ["mean"]


def test_invalid_arguments_are_refused() -> None:
    needy = type("Needy", (Mean,), {"__init__": lambda self, must: None})
    for models, suite, words in (
        ("meen", SUITE, ("meen", "mean")),
        (3, SUITE, ("3",)),
        (needy, SUITE, ("Needy",)),
        ("mean", "learners-quick", ("learners-quick", "--suite")),
        ("mean", "quik", ("quik", "quick")),
    ):
        with refuses(ValueError, *words):
            benchmark(models, suite, workers=0, progress=False)  # type: ignore[arg-type]
