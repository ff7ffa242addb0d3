"""`python -m studies.defend`: its files, its resume, its saved network, and what it refuses."""

import csv
import json
import shlex
import shutil

import pytest

pytest.importorskip("cma")
pytest.importorskip("torch")
pytest.importorskip("safetensors")

from attackers_suite import SUITE
from study_line import app
from typer.testing import CliRunner

from roletrust_agents.learned.saved_defence import SavedTrust, load_defence
from studies.defence.fronts import Front

pytestmark = pytest.mark.slow

SHORT = ["--iterations", "1", "--budget", "8000", "--steps", "1", "--games", "3", "--fresh", "3"]
MODELS = ["--model", "mean", "--model", "role-trust", "--defence", "network"]


def run(folder, *arguments):
    suite = folder / "tiny.toml"
    suite.write_text(SUITE.replace("shares = [0.5]", "shares = [0.25, 0.5]"))
    where = ["--suite", str(suite), "--front", "small/raters/0.5", "--world", "small/raters/0.25"]
    options = ["defend", *where, *SHORT, *MODELS, "--out", str(folder / "out"), *arguments]
    result = CliRunner().invoke(app, options, env={"COLUMNS": "400"})
    return result.exit_code, " ".join(result.output.split())


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    folder = tmp_path_factory.mktemp("defend")
    code, printed = run(folder)
    assert code == 0, printed
    return folder, printed


def rows(folder, name):
    with (folder / "out" / name).open() as file:
        return list(csv.DictReader(file))


def by_name(table):
    """The rows of a table by their names, that of a learned model without its iteration."""
    names = ("iteration", "model", "beside")
    return {tuple(row[n].removesuffix(" 1") for n in names if n in row): row for row in table}


def test_its_files_say_the_same(played):
    folder, printed = played
    (iteration,) = rows(folder, "iterations.csv")
    page = (folder / "out" / "defence.md").read_text()
    assert f"{float(iteration['nash_conv']):.3f} ± " in page
    assert f"{float(iteration['nash_conv']):.3f} ± " in printed
    models = rows(folder, "comparison.csv")
    assert {row["model"] for row in models} == {"network, trained 1", "mean", "role-trust"}
    for row in models:
        assert f"| `{row['model']}` | {float(row['clean']):.3f} ± " in page
    assert "Made by `python -m studies.defend --defence network --model mean --model role-trust --suite " in page
    assert (folder / "out" / "defence.png").stat().st_size > 10_000
    kept = json.loads((folder / "out" / "defence.json").read_text())
    assert kept["made_with"]["package"]["name"] == "roletrust-env"
    assert kept["made_with"]["conditions"]["small/raters/0.5"]["compromised"] == ["sr_2", "sr_3"]


def test_the_network_is_saved_as_it_played(played):
    folder, _ = played
    card, weights = load_defence(folder / "out" / "network")
    spec = json.loads((folder / "out" / "defence.json").read_text())["runs"]["defence|0|network"]["spec"]
    numbers, _, listed = spec.partition("weights=")
    assert json.loads(listed) == weights.tolist()
    assert all(f"{name}={value}" in numbers for name, value in card.parameters.items())
    assert SavedTrust(path=str(folder / "out" / "network.json")).power == card.parameters["power"]


def test_a_model_is_saved_as_model_takes_it(tmp_path):
    assert run(tmp_path, "--defence", "beta")[0] == 0
    spec = (tmp_path / "out" / "beta.txt").read_text().strip()
    assert spec.startswith("beta:keep=")
    runs = json.loads((tmp_path / "out" / "defence.json").read_text())["runs"]
    assert spec == runs["defence|0|beta"]["spec"]


def test_screen_and_page_have_the_same_headings_and_caveats(played):
    folder, printed = played
    page = (folder / "out" / "defence.md").read_text()
    headings = [line for line in page.splitlines() if line.startswith(("| iteration", "| model"))]
    assert len(headings) == 3
    for heading in " ".join(headings).strip("| ").replace("| |", "|").split(" | "):
        assert heading in printed
    legend = "Strangers: under the worst attacker that no training has met."
    scripts = (
        "small/raters/0.25: the suite tiny knows no attackers there, so strangers are its scripts at their defaults."
    )
    few = "3 games choose the worst attack, which is mostly chance; give 12 or more."
    for text in (legend, scripts, few):
        assert text in printed
        assert text in page
    assert "1 condition of tiny" in page


def test_what_is_next_can_be_given(played):
    _, printed = played
    words = shlex.split(printed.partition("Next: roletrust ")[2])
    assert words[:2] == ["benchmark", "--model"]
    assert SavedTrust.__name__ in words[2]
    result = CliRunner().invoke(app, [*words, "--dry-run"])
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("name", ["beta", "roletrust_env.trust.models.central.leave_one_out:LeaveOneOut"])
def test_two_games_are_enough_and_an_own_class_learns(tmp_path, name):
    suite = tmp_path / "tiny.toml"
    suite.write_text(SUITE)
    options = ["--suite", str(suite), "--front", "small/raters/0.5", "--world", "small/raters/0.5", "--model", "mean"]
    few = [*SHORT, "--games", "2", "--fresh", "2", "--defence", name, "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, ["defend", *options[:4], "--world", "small/raters/0.25", *options[6:], *few])
    assert result.exit_code == 0, result.output
    spec = (tmp_path / "out" / f"{name.replace(':', '.')}.txt").read_text()
    assert spec.startswith(f"{name}:keep=")


def test_a_condition_that_the_suite_attacks_has_strangers():
    assert Front.of("standard", "crowd/raters/0.4").has_strangers
    assert not Front.of("standard", "crowd/raters/0.35").has_strangers


def test_a_repeat_says_the_same(played):
    folder, _ = played
    before = {path.name: path.read_bytes() for path in (folder / "out").iterdir() if path.suffix != ".png"}
    assert run(folder)[0] == 0
    assert {path.name: path.read_bytes() for path in (folder / "out").iterdir() if path.suffix != ".png"} == before


def test_several_runs_are_the_mean_of_single_commands_and_play_nothing_again(played, tmp_path, monkeypatch):
    folder, _ = played
    first, second = (tmp_path / "out" / f"seed-{seed}" for seed in (0, 1))
    shutil.copytree(folder / "out", first)
    code, printed = run(tmp_path, "--runs", "2")
    assert code == 0, printed
    assert (first / "defence.json").read_bytes() == (folder / "out" / "defence.json").read_bytes()
    assert load_defence(second / "network")[0].seed == 1
    monkeypatch.setattr(Front, "skills", None)  # nothing may be played
    assert run(tmp_path, "--seed", "1", "--out", str(second))[0] == 0
    for name, last in (("comparison.csv", "worlds"), ("iterations.csv", "single"), ("leads.csv", "worlds")):
        parts = [by_name(rows(tmp_path, part)) for part in (f"seed-0/{name}", f"seed-1/{name}", name)]
        assert parts[0].keys() == parts[1].keys() == parts[2].keys()
        for key, both in parts[2].items():
            values = [float(part[key][last]) for part in parts[:2]]
            assert float(both[last]) == pytest.approx(sum(values) / 2, abs=1e-5)
            assert float(both[f"{last}_high"]) >= max(values)
    models = {row["model"] for row in rows(tmp_path, "comparison.csv")}
    assert models == {"network, trained", "mean", "role-trust"}
    for text in ("2 runs, 95% intervals over runs and games", "--runs 2`; `defence.json` of each run has"):
        assert text in (tmp_path / "out" / "defence.md").read_text()
    assert "seed-0/defence.json, seed-0/network.safetensors" in printed


def test_an_interruption_keeps_what_is_finished(tmp_path, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("studies.defence.double_oracle.train_defence", stopped)
    code, printed = run(tmp_path)
    assert (code, "Stopped. Finished steps are saved; repeat the command without --force." in printed) == (130, True)
    assert "attack|0|small/raters/0.5" in json.loads((tmp_path / "out" / "defence.json").read_text())["runs"]


def test_other_settings_are_not_mixed(played):
    folder, _ = played
    code, printed = run(folder, "--seed", "1")
    assert (code, "another seed; give --force" in printed) == (2, True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--defence", "constant"], "has no number that can be learned"),
        (["--defence", "netwrk"], "did you mean 'network'"),
        (["--defence", "beta:keep=0.5"], "'beta:keep=0.5' has parameters; name the model alone"),
        (["--defence", "roletrust_env.nowhere:Model"], "'roletrust_env.nowhere:Model' cannot be loaded"),
        (["--budget", "-1"], "an attacker needs 3072 or more"),
        (["--world", "small/raters/0.5"], "is a condition of the training"),
        (["--world", "small/raters/0.50"], "is a condition of the training"),
        (["--front", "small/raters"], "a front is SCENARIO/TRACK/SHARE"),
        (["--model", "bta"], "did you mean 'beta'"),
        (["--budget", "10"], "an attacker needs 3072 or more"),
    ],
)
def test_what_does_not_fit_is_refused_before_anything_is_written(tmp_path, arguments, message):
    code, printed = run(tmp_path, *arguments)
    assert (code, message in printed) == (2, True), printed
    assert not (tmp_path / "out").exists()


def emptied(run):
    run.clear()


def beyond(run):
    run["vector"].append(0.5)


def undefined(run):
    next(iter(run.values()))[0][0] = float("nan")


def beyond_all(run):
    next(iter(run.values()))[0][0] = 1e308


def shorter(run):
    next(iter(run.values()))[1].pop()


@pytest.mark.parametrize(
    ("key", "damage", "message"),
    [
        ("start|small/raters/0.5", emptied, "run 'start|small/raters/0.5': field attackers is missing"),
        ("start|small/raters/0.5", lambda run: run["attackers"].clear(), "attackers"),
        ("attack|0|small/raters/0.5", lambda run: run["attacker"].update(record="{}"), "must be an object with a kind"),
        ("payoff|small/raters/0.5|mean", undefined, "NaN, which is not a number"),
        ("payoff|small/raters/0.5|mean", beyond_all, "less than or equal to 1000000"),
        ("payoff|small/raters/0.5|mean", shorter, "it has 2 games; the settings have 3"),
        ("seen|1|small/raters/0.5|mean", emptied, "attacks"),
        ("held out|small/raters/0.25|mean", shorter, "it has 2 games"),
        ("clean|small/raters/0.5|mean", lambda run: run.update(skill=None), "skill is None"),
        ("defence|0|network", beyond, "numbers; network has"),
        ("defence|0|network", lambda run: run.update(spec="mean"), "spec and vector are not of one model"),
        ("own|1|small/raters/0.5|mean", emptied, "field attacker is missing"),
    ],
)
def test_a_damaged_step_is_one_line_that_names_it(played, tmp_path, key, damage, message):
    folder, _ = played
    data = json.loads((folder / "out" / "defence.json").read_text())
    damage(data["runs"][key])
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "defence.json").write_text(json.dumps(data))
    code, printed = run(tmp_path)
    assert (code, "defence.json holds no runs of this command: " in printed) == (2, True), printed
    assert message in printed
    assert printed.endswith("; give --force to begin again, or another --out")
    assert len(printed) < 1500
