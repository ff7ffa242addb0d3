"""`python -m studies.budget`: its files, its resume, and what it leaves out or refuses."""

import csv
import json

import pytest

pytest.importorskip("cma")
pytest.importorskip("stable_baselines3")

from attackers_suite import condition
from study_line import app
from typer.testing import CliRunner

from roletrust_env.benchmarking.cells import task_arguments
from roletrust_env.benchmarking.suite import Cell
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.evaluation.measurement import exact_task, score
from roletrust_env.evaluation.search import Budget, search_methods
from roletrust_env.evaluation.specs import parse_kinds
from studies.attackers import budget as searches
from studies.attackers.budget import WAYS, known_ways

pytestmark = pytest.mark.slow

FEW = ["--model", "beta", "--model", "role-trust", "--budget", "1600", "--budget", "3000", "--runs", "2"]
TWO_WAYS = ["--way", "scripts", "--way", "random search"]


def run(folder, *arguments):
    options = ["budget", *condition(folder), "--out", str(folder / "out"), *arguments]
    return CliRunner().invoke(app, options, env={"COLUMNS": "400"})


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """A folder with the runs of two models, two ways, two budgets and two seeds."""
    folder = tmp_path_factory.mktemp("budget")
    result = run(folder, *FEW, *TWO_WAYS)
    assert result.exit_code == 0, result.output
    return folder, result.output


def lines(folder):
    with (folder / "out" / "budget.csv").open() as file:
        return list(csv.DictReader(file))


def test_every_search_has_its_line_and_the_files_are_there(played):
    folder, output = played
    rows = lines(folder)
    assert len(rows) == 2 * (2 + 2 * 2)  # models x (seeds of the scripts + budgets x seeds)
    for row in rows:
        assert 0 <= float(row["utility"]) <= 1
        assert float(row["seconds"]) >= 0
        if row["way"] == "scripts":
            assert int(row["rounds"]) == 2 * 40 * 6  # both scripts, 40 games of 6 rounds
        else:
            assert int(row["rounds"]) <= int(row["budget"])
    assert (folder / "out" / "budget.png").stat().st_size > 10_000
    page = (folder / "out" / "budget.md").read_text()
    assert "| model | way | 1,600 | 3,000 |" in page
    assert "| beta | scripts, 480 rounds | " in page
    assert "`beta` is `Beta(" in page
    assert "beta: random search" in output
    settings = json.loads((folder / "out" / "budget.json").read_text())["made_with"]
    assert settings["condition"]["compromised"] == ["sr_2", "sr_3"]
    assert settings["packages"]["numpy"]
    assert not list((folder / "out").glob(".*"))


def test_a_search_is_measured_in_games_with_another_seed(played):
    folder, _ = played
    suite = load_suite(folder / "tiny.toml")
    arguments = task_arguments(suite, Cell("beta", "small", "raters", 0.5, "random search", 0))
    kinds = parse_kinds(["bad-mouthing", "ballot-stuffing"], arguments["scenario"])
    found = search_methods.make("random search", attacks=kinds).search(arguments, Budget(3000), 1)
    row = next(r for r in lines(folder) if [*r.values()][:4] == ["beta", "random search", "3000", "1"])
    utility = score(exact_task(arguments), found.attacker, 1_000_001, (1, 6)).scores["utility"].mean()
    assert float(row["utility"]) == pytest.approx(utility, abs=1e-6)


def test_finished_searches_are_not_played_again(played, monkeypatch):
    folder, _ = played
    before, again = lines(folder), []
    play = searches.play_point

    def watched(condition, point, games):
        again.append(point)
        return play(condition, point, games)

    monkeypatch.setattr("studies.budget.play_point", watched)
    path = folder / "out" / "budget.json"
    stored = json.loads(path.read_text())
    del stored["runs"]["beta|scripts|0|1"]
    path.write_text(json.dumps(stored))
    result = run(folder, *FEW, *TWO_WAYS)
    assert result.exit_code == 0, result.output
    assert "11 of 12 runs are there already" in result.output
    assert again == [("beta", "scripts", 0, 1)]
    without_time = [[{**row, "seconds": None} for row in rows] for rows in (before, lines(folder))]
    assert without_time[0] == without_time[1]
    refused = run(folder, *FEW, *TWO_WAYS, "--games", "7")
    assert refused.exit_code == 2
    assert "holds runs with another games; give --force" in refused.stderr


def test_what_does_not_suit_a_budget_is_left_out_with_a_line(tmp_path):
    ways = "--way", "evolution", "--way", "scripts", "--way", "random search"
    result = run(tmp_path, "--model", "beta", *ways, "--budget", "1600", "--runs", "1")
    assert result.exit_code == 0, result.output
    assert "left out: evolution with 1,600 rounds: the budget of 1600 rounds is too small" in result.output
    page = (tmp_path / "out" / "budget.md").read_text()
    assert "- Left out: evolution with 1,600 rounds: the budget of 1600 rounds is too small" in page
    assert [row["way"] for row in lines(tmp_path) if row["left_out"]] == ["evolution"]
    assert "| beta | evolution |" not in page
    assert "| beta | random search |" in page


def test_a_learner_on_torch_does_not_learn_for_long(tmp_path):
    result = run(tmp_path, "--model", "beta", "--way", "PPO", "--way", "scripts", "--budget", "100001", "--runs", "1")
    assert "left out: PPO with 100,001 rounds: a learner on torch gets 100,000 rounds" in result.output


def test_without_any_search_there_is_one_error(tmp_path):
    result = run(tmp_path, "--model", "beta", "--way", "evolution", "--budget", "50", "--runs", "1")
    assert result.exit_code == 2
    assert "no search was played" in result.stderr


def test_a_way_may_have_parameters(tmp_path):
    ways = "--way", "random search:name=mine"
    result = run(tmp_path, "--model", "mean", *ways, "--budget", "1600", "--runs", "1")
    assert result.exit_code == 0, result.output
    assert [row["way"] for row in lines(tmp_path)] == ["random search:name=mine"]
    result = run(
        tmp_path,
        "--force",
        "--model",
        "mean",
        "--way",
        "coalition PPO:start=random",
        "--budget",
        "100001",
        "--runs",
        "1",
    )
    assert "gets 100,000 rounds at most" in result.output


def test_a_way_that_is_not_installed_is_no_default():
    installed = ["scripts", *search_methods.names()]
    assert known_ways(None) == [way for way in WAYS if way in installed]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--model", "betta"], "unknown trust model 'betta'; did you mean 'beta'?"),
        (["--way", "evolution:begin=random"], "has no parameter 'begin'"),
        (["--way", "evolutoin"], "unknown way 'evolutoin'; did you mean 'evolution'?"),
        (["--scenario", "crwd"], "suite tiny has no scenario 'crwd' with attackers"),
        (["--track", "honest"], "suite tiny has no track 'honest' with attackers"),
        (["--share", "0.9"], "compromises 4 of 4 agents"),
        (["--share", "1.5"], "the share of compromised agents is 1.5"),
        (["--suite", "learners"], "the suite learners is one for learners"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(tmp_path, arguments, reason):
    result = run(tmp_path, *arguments)
    assert result.exit_code == 2
    assert reason in result.stderr
    assert "Traceback" not in result.output
    assert not (tmp_path / "out").exists()


def test_a_file_of_another_kind_is_left_alone(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "budget.json").write_text("[]")
    assert "holds no runs of this command" in run(tmp_path, *FEW).stderr
    assert (tmp_path / "out" / "budget.json").read_text() == "[]"
