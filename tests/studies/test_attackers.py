"""Budgets and transfer of attackers in a tiny suite."""

import json

import pytest
from attackers_suite import condition
from csv_files import csv_rows

from studies.budget import Level, Point, left_out, levels
from studies.study import run
from studies.transfer import Coalition

pytestmark = pytest.mark.slow


def test_budgets_of_scripts_and_of_a_search(tmp_path):
    methods = [
        "--method",
        "scripts",
        "--method",
        "random search",
        "--budget",
        "500",
        "--budget",
        "5000",
    ]
    models = ["--model", "mean", "--model", "beta:keep=0.5"]
    run(
        "studies.budget",
        [*condition(tmp_path), *methods, *models, "--runs", "2", "--out", str(tmp_path)],
    )
    found = csv_rows(tmp_path / "budget.csv")
    assert len(found) == 2 * (1 + 2) * 2
    rounds = 2 * 40 * 6  # scripts x games x rounds of a game
    assert {row["rounds"] for row in found if row["method"] == "scripts"} == {str(rounds)}
    assert all(0 <= float(row["utility"]) <= 1 for row in found if row["budget"] != "500")
    assert all("too small" in row["left_out"] for row in found if row["budget"] == "500")
    page = (tmp_path / "budget.md").read_text()
    assert "- Left out: random search with 500 rounds: " in page
    assert (tmp_path / "budget.png").stat().st_size > 1000


def test_levels_are_means_over_seeds():
    searches = [Point("mean", "evolution", 9, seed) for seed in (0, 1)] + [
        Point("mean", "PPO", 9, 0)
    ]
    runs = {
        "mean|evolution|9|0": {"utility": 0.2, "rounds": 8, "seconds": 1.0},
        "mean|evolution|9|1": {"utility": 0.4, "rounds": 10, "seconds": 2.0},
        "mean|PPO|9|0": {"left_out": "too few"},
    }
    (level,) = levels(searches, runs)
    assert level[:4] == ("mean", "evolution", 9, 9)
    assert (level.utility.mean, level.seconds) == (pytest.approx(0.3), 1.5)
    assert isinstance(level, Level)
    searches.append(Point("mean", "PPO", 90, 0))
    runs["mean|PPO|90|0"] = runs["mean|PPO|9|0"]
    assert list(left_out(searches, runs)) == ["PPO with 9, 90 rounds: too few"]


def test_coalitions_play_on_all_columns(tmp_path):
    models = ["--model", "mean", "--on", "median", "--budget", "20000", "--runs", "1"]
    run("studies.transfer", [*condition(tmp_path), *models, "--out", str(tmp_path)])
    found = csv_rows(tmp_path / "transfer.csv")
    assert [row["played_on"] for row in found[:2]] == ["mean", "median"]
    assert [row["seen"] for row in found[:2]] == ["True", "False"]
    assert {row["universal"] for row in found} == {"True", "False"}
    kept = json.loads((tmp_path / "runs.json").read_text())["runs"]["trained on|mean|0"]
    assert float(found[0]["utility"]) == pytest.approx(kept["utility"]["mean"], abs=1e-6)
    assert "below 0.5." in (tmp_path / "transfer.md").read_text()


def test_a_universal_coalition_knows_its_models_with_any_parameters():
    universal = Coalition("universal-raters", ("beta", "mean"), universal=True)
    assert [universal.knows(model) for model in ("beta", "beta:keep=0.5", "beta-filtered")] == [
        True,
        True,
        False,
    ]
    assert not Coalition("beta", ("beta",)).knows("beta:keep=0.5")
