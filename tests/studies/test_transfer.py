"""`python -m studies.transfer`: its table, its files, its resume, and its universal rows."""

import csv
import json

import pytest

pytest.importorskip("cma")
pytest.importorskip("safetensors")

from attackers_suite import condition
from study_line import app
from typer.testing import CliRunner

from roletrust_env.metrics.confidence import Estimate
from studies.attackers import transfer as rows_of
from studies.attackers.transfer import Cell, Coalition, sentences

pytestmark = pytest.mark.slow

BUDGET = ["--budget", "8000", "--runs", "2"]
TWO = ["--model", "mean", "--model", "beta"]


def run(folder, *arguments):
    options = ["transfer", *condition(folder), "--out", str(folder / "out"), *BUDGET, *arguments]
    return CliRunner().invoke(app, options, env={"COLUMNS": "400"})


@pytest.fixture(autouse=True)
def no_universal(monkeypatch):
    """The rows of universal coalitions depend on what comes with the project."""
    monkeypatch.setattr(rows_of, "universal_coalitions", dict)


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """A folder with the runs of two trust models and two seeds."""
    folder = tmp_path_factory.mktemp("transfer")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rows_of, "universal_coalitions", dict)
        result = run(folder, *TWO)
    assert result.exit_code == 0, result.output
    return folder, result.output


def lines(folder):
    with (folder / "out" / "transfer.csv").open() as file:
        return {(row["trained_on"], row["played_on"]): row for row in csv.DictReader(file)}


def test_every_pair_has_its_number_and_the_files_are_there(played):
    folder, output = played
    rows = lines(folder)
    assert set(rows) == {(row, column) for row in ("mean", "beta") for column in ("mean", "beta")}
    assert {pair for pair, row in rows.items() if row["seen"] == "True"} == {("mean", "mean"), ("beta", "beta")}
    runs = json.loads((folder / "out" / "transfer.json").read_text())["runs"]
    assert len(runs) == 4
    for (row, column), cell in rows.items():
        seeds = [runs[f"trained on|{row}|{seed}"]["utility"][column] for seed in (0, 1)]
        assert float(cell["utility"]) == pytest.approx(sum(seeds) / 2, abs=1e-6)
    assert all(0 < run["rounds"] <= 8000 for run in runs.values())
    page = (folder / "out" / "transfer.md").read_text()
    assert "| trained on | mean | beta |" in page
    assert f"| mean | {float(rows['mean', 'mean']['utility']):.2f}* |" in page
    unseen = (float(rows["mean", "beta"]["utility"]) + float(rows["beta", "mean"]["utility"])) / 2
    assert f"on the others: mean utility {unseen:.3f}; " in page
    assert f"mean utility {unseen:.3f}; " in output
    assert (folder / "out" / "transfer.png").stat().st_size > 10_000


def test_a_further_column_plays_only_what_is_missing(played, monkeypatch):
    folder, _ = played
    before, calls = lines(folder), []
    play = rows_of.play_row
    monkeypatch.setattr(rows_of, "play_row", lambda *job: calls.append(job) or play(*job))
    assert run(folder, *TWO).exit_code == 0
    assert calls == []
    further = "roletrust_env.trust.models.central.median:Median"
    result = run(folder, *TWO, "--on", further)
    assert result.exit_code == 0, result.output
    assert [(job[1].name, job[2], job[3]) for job in calls] == [
        (row, seed, [further]) for row in ("mean", "beta") for seed in (0, 1)
    ]
    after = lines(folder)
    assert {pair: after[pair] for pair in before} == before
    assert ("beta", further) in after
    assert (further, "beta") not in after


def test_a_universal_coalition_is_a_row_with_marks(tmp_path, monkeypatch):
    import numpy as np

    from roletrust_agents.learned.cards import ModelCard
    from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture, random_weights

    architecture = DeepSetArchitecture()
    network = DeepSet.unflatten(architecture, random_weights(architecture, np.random.default_rng(0)).astype(np.float32))

    class Saved:
        class card:
            trust_model = ModelCard(name="mean")
            further_models = (ModelCard(name="median"),)

    monkeypatch.setattr(rows_of, "universal_coalitions", lambda: {"universal-raters": network})
    monkeypatch.setattr(rows_of, "load_attacker", lambda name: Saved)
    result = run(tmp_path, "--model", "mean", "--on", "beta")
    assert result.exit_code == 0, result.output
    rows = lines(tmp_path)
    assert rows["universal-raters", "mean"]["seen"] == "True"
    assert rows["universal-raters", "beta"]["seen"] == "False"
    assert "universal-raters, on models it was not trained on: mean utility" in result.output
    runs = json.loads((tmp_path / "out" / "transfer.json").read_text())["runs"]
    assert runs["universal|universal-raters|0"]["rounds"] == 0


def test_the_sentences_count_unseen_models_below_the_limit():
    one = Coalition("mean", ("mean",))
    universal = Coalition("universal-raters", ("mean", "beta"), universal=True)
    cells = [
        [Cell(row, model, Estimate(mean, 0.0)) for model, mean in (("mean", 0.1), ("beta", 0.4), ("qor", 0.8))]
        for row in (one, universal)
    ]
    assert sentences(cells) == [
        "Coalitions trained on one model, on the others: mean utility 0.600; 1 of 2 below 0.5.",
        "universal-raters, on models it was not trained on: mean utility 0.800; 0 of 1 below 0.5.",
    ]
    assert universal.knows("mean:lam=0.9")
    assert not one.knows("mean:lam=0.9")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--model", "betta"], "unknown trust model 'betta'; did you mean 'beta'?"),
        (["--model", "beta", "--on", "betta"], "unknown trust model 'betta'; did you mean 'beta'?"),
        (["--model", "beta", "--track", "rater"], "suite tiny has no track 'rater' with attackers"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(tmp_path, arguments, reason):
    result = run(tmp_path, *arguments)
    assert result.exit_code == 2
    assert reason in result.stderr
    assert not (tmp_path / "out").exists()


def test_a_budget_that_is_too_small_for_a_training_is_named(tmp_path):
    result = run(tmp_path, "--model", "beta", "--budget", "50")
    assert result.exit_code == 2
    assert "trained on|beta|0: the budget of 50 rounds is too small for evolution" in result.output
    assert "no row of the table could be played" in result.stderr
