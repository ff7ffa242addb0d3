"""The study of learned defence in its smallest form: its files, its resume, its saved models, and what it refuses."""

import csv
import json
import shutil

import pytest
from attackers_suite import SUITE

from roletrust_agents.learned.saved_defence import SavedTrust, load_defence
from studies.defence.fronts import Front
from studies.defend import main

pytestmark = pytest.mark.slow

SHORT = ["--iterations", "1", "--budget", "8000", "--steps", "1", "--games", "3", "--fresh", "3"]
MODELS = ["--model", "mean", "--model", "role-trust", "--beside", "mean"]


def run(folder, *arguments, runs=1, defence="network"):
    suite = folder / "tiny.toml"
    suite.write_text(SUITE.replace("shares = [0.5]", "shares = [0.25, 0.5]"))
    where = ["--suite", str(suite), "--front", "small/raters/0.5", "--world", "small/raters/0.25"]
    main([*where, *SHORT, *MODELS, "--runs", str(runs), "--defence", defence, "--out", str(folder / "out"), *arguments])


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    folder = tmp_path_factory.mktemp("defend")
    run(folder)
    return folder


def rows(folder, name):
    with (folder / "out" / name).open() as file:
        return list(csv.DictReader(file))


def by_name(table):
    """The rows of a table by their names, that of a learned model without its iteration."""
    names = ("iteration", "model", "beside")
    return {tuple(row[n].removesuffix(" 1") for n in names if n in row): row for row in table}


def test_its_files_say_the_same(played):
    (iteration,) = rows(played, "iterations.csv")
    page = (played / "out" / "defence.md").read_text()
    assert f"{float(iteration['nash_conv']):.3f} ± " in page
    models = rows(played, "comparison.csv")
    assert {row["model"] for row in models} == {"network, trained 1", "mean", "role-trust"}
    for row in models:
        assert f"| `{row['model']}` | {float(row['clean']):.3f} ± " in page
    assert "small/raters/0.25: the suite tiny knows no attackers there" in page
    assert "3 games choose the worst attack, which is mostly chance; give 12 or more." in page
    assert (played / "out" / "defence.png").stat().st_size > 10_000


def test_models_are_saved_as_they_played(played, tmp_path):
    card, weights = load_defence(played / "out" / "seed-0" / "network")
    spec = json.loads((played / "out/seed-0/runs.json").read_text())["runs"]["defence|0|network"]["spec"]
    numbers, _, listed = spec.partition("weights=")
    assert json.loads(listed) == weights.tolist()
    assert all(f"{name}={value}" in numbers for name, value in card.parameters.items())
    path = played / "out" / "seed-0" / "network.json"
    assert SavedTrust(path=str(path)).power == card.parameters["power"]
    run(tmp_path, defence="beta")
    assert (tmp_path / "out" / "seed-0" / "beta.txt").read_text().startswith("beta:keep=")


def test_several_runs_are_the_mean_of_single_ones_and_play_nothing_again(played, tmp_path, monkeypatch):
    shutil.copytree(played / "out", tmp_path / "out")
    run(tmp_path, runs=2)
    kept = (tmp_path / "out/seed-0/runs.json").read_bytes()
    assert kept == (played / "out/seed-0/runs.json").read_bytes()
    monkeypatch.setattr(Front, "skills", None)  # nothing may be played
    tables = {name: by_name(rows(tmp_path, name)) for name in ("comparison.csv", "iterations.csv", "leads.csv")}
    single = []
    for seed in (0, 1):
        run(tmp_path, "--seed", str(seed))
        single.append({name: by_name(rows(tmp_path, name)) for name in tables})
    for name, last in (("comparison.csv", "worlds"), ("iterations.csv", "single"), ("leads.csv", "worlds")):
        for key, both in tables[name].items():
            values = [float(one[name][key][last]) for one in single]
            assert float(both[last]) == pytest.approx(sum(values) / 2, abs=1e-5)
            assert float(both[f"{last}_high"]) >= max(values)


def test_an_interruption_keeps_what_is_finished(tmp_path, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("studies.defence.double_oracle.train_defence", stopped)
    with pytest.raises(SystemExit) as error:
        run(tmp_path)
    assert error.value.code == 130
    assert "attack|0|small/raters/0.5" in json.loads((tmp_path / "out/seed-0/runs.json").read_text())["runs"]


def test_what_does_not_fit_is_refused_before_anything_is_written(tmp_path, capsys):
    for arguments, message in (
        (["--defence", "constant"], "has no number that can be learned"),
        (["--defence", "netwrk"], "did you mean 'network'"),
        (["--world", "small/raters/0.50"], "is a condition of the training"),
        (["--front", "small/raters"], "a front is SCENARIO/TRACK/SHARE"),
        (["--model", "bta"], "did you mean 'beta'"),
        (["--budget", "10"], "an attacker needs 3072 or more"),
    ):
        with pytest.raises(SystemExit) as error:
            run(tmp_path, *arguments)
        assert error.value.code == 2
        assert message in capsys.readouterr().err
        assert not (tmp_path / "out").exists()


def test_a_condition_that_the_suite_attacks_has_strangers():
    assert Front.of("standard", "crowd/raters/0.4").has_strangers
    assert not Front.of("standard", "crowd/raters/0.35").has_strangers
