"""The study of learned defence in its smallest form: its files, its saved models, and what it
refuses."""

import json

import pytest
from attackers_suite import SUITE
from csv_files import csv_rows
from refusals import names

from roletrust_agents.learned.saved_defence import SavedTrust, load_defence
from studies.study import run

pytestmark = pytest.mark.slow

SHORT = [
    "--iterations",
    "1",
    "--budget",
    "8000",
    "--steps",
    "1",
    "--games",
    "3",
    "--fresh",
    "3",
    "--workers",
    "1",
]
MODELS = ["--model", "mean", "--model", "role-trust", "--beside", "mean"]


def play(folder, *arguments):
    suite = folder / "tiny.toml"
    suite.write_text(SUITE.replace("shares = [0.5]", "shares = [0.25, 0.5]"))
    where = ["--suite", str(suite), "--front", "small/raters/0.5", "--world", "small/raters/0.25"]
    run(
        "studies.defend",
        [
            *where,
            *SHORT,
            *MODELS,
            "--runs",
            "1",
            "--defence",
            "network",
            "--out",
            str(folder / "out"),
            *arguments,
        ],
    )


def rows(folder, name):
    return csv_rows(folder / "out" / name)


def by_name(table):
    """Return the rows of a table by their names, that of a learned model without its iteration."""
    names = ("iteration", "model", "beside")
    return {tuple(row[n].removesuffix(" 1") for n in names if n in row): row for row in table}


def test_its_files_say_the_same_and_several_runs_are_the_mean_of_single_ones(tmp_path, monkeypatch):
    play(tmp_path, "--runs", "2")
    monkeypatch.setattr("studies.defend.play_game", None)  # nothing may be played again
    tables = {
        name: by_name(rows(tmp_path, name))
        for name in ("comparison.csv", "iterations.csv", "leads.csv")
    }
    single, kept = [], tmp_path / "out" / "runs.json"
    for seed in (0, 1):
        runs = json.loads(kept.read_text())
        runs["made_with"]["seed"] = seed  # a folder keeps the runs of a study from one seed on
        kept.write_text(json.dumps(runs))
        play(tmp_path, "--seed", str(seed))
        single.append({name: by_name(rows(tmp_path, name)) for name in tables})
    for name, last in (
        ("comparison.csv", "worlds"),
        ("iterations.csv", "single"),
        ("leads.csv", "worlds"),
    ):
        for key, both in tables[name].items():
            values = [float(one[name][key][last]) for one in single]
            assert float(both[last]) == pytest.approx(sum(values) / 2, abs=1e-5)
            assert float(both[f"{last}_high"]) >= max(values)
    (iteration,) = rows(tmp_path, "iterations.csv")
    page = (tmp_path / "out" / "defence.md").read_text()
    assert f"{float(iteration['nash_conv']):.3f} ± " in page
    models = rows(tmp_path, "comparison.csv")
    assert {row["model"] for row in models} == {"network, trained 1", "mean", "role-trust"}
    for row in models:
        assert f"| `{row['model']}` | {float(row['clean']):.3f} ± " in page
    assert (tmp_path / "out" / "defence.png").stat().st_size > 10_000
    card, weights = load_defence(tmp_path / "out" / "seed-0" / "network")
    played = json.loads((tmp_path / "out/runs.json").read_text())["runs"]["seed-0"]
    numbers, _, listed = played["specs"]["network, trained 1"].partition("weights=")
    assert json.loads(listed) == weights.tolist()
    assert all(f"{name}={value}" in numbers for name, value in card.parameters.items())
    path = tmp_path / "out" / "seed-0" / "network.json"
    assert SavedTrust(path=str(path)).power == card.parameters["power"]


def test_what_does_not_fit_is_refused(tmp_path, capsys):
    for arguments, word in (
        (["--defence", "constant"], "constant"),
        (["--defence", "netwrk"], "network"),
        (["--front", "small/raters"], "front"),
        (["--model", "bta"], "beta"),
    ):
        with pytest.raises(SystemExit) as error:
            play(tmp_path, *arguments)
        assert error.value.code == 2
        assert names(capsys.readouterr().err, word)
