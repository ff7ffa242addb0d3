import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from experiments.attacks import parse_attacks, parse_settings, parse_trust_model, parse_value
from experiments.cli import app
from experiments.confidence import over_games, student_95
from roletrust_env import __version__, make_scenario, scenarios, trust_models

TINY = ["--set", "max_cycles=12"]


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))


def play(out, *arguments):
    result = run("play", *arguments, *TINY, "--out", str(out))
    assert result.exit_code == 0, result.output
    return json.loads((out / "results.json").read_text()), result.output


def test_one_game_with_two_attackers(tmp_path):
    attacks = ["--attack", "sp_2=on-off:start=3,period=4", "--attack", "sr_1=bad-mouthing:level=0.2,targets=[0,1]"]
    results, printed = play(tmp_path, *attacks)
    assert results["attackers"]["sp_2"]["parameters"]["period"] == 4
    assert results["attackers"]["sr_1"]["parameters"]["targets"] == [0, 1]
    assert results["scenario"]["max_cycles"] == 12
    assert results["measured"]["sp_2, OnOff"]["mean trust"]["half_95"] is None
    assert "sp_2, OnOff" in printed
    with (tmp_path / "curves.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 12 * 6
    assert rows[0] == {"time_s": "0.500000", "agent": "sr_0", "trust": "ToR", "mean": "0.500000"} | {
        "low": "",
        "high": "",
        "games": "1",
    }
    assert (tmp_path / "curves.png").stat().st_size > 1000
    assert not list(tmp_path.glob(".*"))


def test_several_games_have_intervals(tmp_path):
    results, printed = play(tmp_path, "--games", "3")
    assert "±" in printed
    for measures in results["measured"].values():
        assert all(value["half_95"] is not None for value in measures.values())


def test_seed_decides(tmp_path):
    curves = []
    for i, seed in enumerate((1, 1, 2)):
        play(tmp_path / str(i), "--seed", str(seed))
        curves.append((tmp_path / str(i) / "curves.csv").read_bytes())
    assert curves[0] == curves[1] != curves[2]


@pytest.mark.parametrize("name", ["crowd-10x10", "robots-that-move", "open-system", "peers"])
def test_every_kind_of_scenario(tmp_path, name):
    attack = {"peers": "srsp_8=on-off"}.get(name, "sr_?=bad-mouthing")
    results, _ = play(tmp_path, name, "--games", "2", "--attack", attack, "--trust-model", "mean:lam=0.8")
    assert results["trust_model"] == {"class": "roletrust_env.trust.mean.Mean"} | {
        "parameters": {"lam": 0.8, "initial": 0.5}
    }


def test_scenario_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('agents = [{role = "SR", count = 2}, {role = "SP"}]\n')
    results, _ = play(tmp_path / "out", str(path))
    assert results["scenario"]["name"] == "mine"


def test_video(tmp_path):
    play(tmp_path, "--attack", "sp_0=on-off", "--video")
    import imageio.v2 as imageio

    with imageio.get_reader(tmp_path / "play.mp4") as film:
        assert film.count_frames() == 12
        assert np.ptp(film.get_data(5)) > 100


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "unknown scenario 'nowhere'"),
        (["nowhere.toml"], "cannot be read"),
        (["--trust-model", "meen"], "did you mean 'mean'"),
        (["--trust-model", "mean:depth=3"], "depth"),
        (["--trust-model", "mean:lam=2"], "lam is 2"),
        (["--attack", "sp_0"], "AGENT=NAME"),
        (["--attack", "sp_0=onoff"], "unknown attacker 'onoff'"),
        (["--attack", "sp_0=on-off:duty=7"], "duty is 7"),
        (["--attack", "sp_0=on-off:duty=much"], "duty is 'much'"),
        (["--attack", "sp_0=on-off:duty"], "field=value"),
        (["--attack", "sp_9=on-off"], "there is no agent 'sp_9'"),
        (["--attack", "xx_*=on-off"], "no agent matches"),
        (["--attack", "sr_0=on-off"], "attacks by quality"),
        (["--attack", "sp_0=on-off", "--attack", "sp_*=on-off"], "two attacks"),
        (["--attack", "sr_0=bad-mouthing:targets=[7]"], "the last provider is 2"),
        (["--set", "lam=0.2"], "lam is 0.2"),
        (["--set", "colour=blue"], "there is no field 'colour'"),
        (["--set", "lam=0.6", "--set", "lam=0.7"], "twice"),
    ],
)
def test_bad_input_is_one_clean_error_and_writes_nothing(tmp_path, arguments, said):
    result = run("play", *arguments, "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert said in result.stderr
    assert "Traceback" not in result.output + result.stderr
    assert result.stderr.count("Error") == 1
    assert not (tmp_path / "out").exists()


def test_folder_that_is_a_file(tmp_path):
    (tmp_path / "out").write_text("in the way")
    result = run("play", *TINY, "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert str(tmp_path / "out") in result.stderr


@pytest.mark.parametrize("arguments", [[], ["scenarios"], ["models"], ["attackers"]])
def test_list(arguments):
    result = run("list", *arguments)
    assert result.exit_code == 0
    assert all(name in result.output for name in scenarios()) == (arguments in ([], ["scenarios"]))
    assert all(name in result.output for name in trust_models()) == (arguments in ([], ["models"]))
    assert ("bad-mouthing" in result.output) == (arguments in ([], ["attackers"]))


def test_list_of_nothing_known():
    assert run("list", "planets").exit_code == 2


def test_version_and_help():
    assert __version__ in run("--version").output
    for command in ("figures", "play", "list"):
        result = run(command, "--help")
        assert result.exit_code == 0
        assert "Examples" in result.output


def test_values():
    assert parse_value("[0, [1]]") == (0, (1,))
    assert parse_value("true") is True
    assert parse_value("random") == "random"
    assert parse_value("1\nother = 2") == "1\nother = 2"
    assert parse_settings(['access={kind = "choice", providers = 2}'])["access"]["providers"] == 2


def test_commas_inside_values_do_not_split():
    policy = parse_attacks(["sr_0=bad-mouthing:targets=[0,1],lie=relative"], make_scenario("paper-3x3"))["sr_0"]
    assert (policy.targets, policy.lie) == ((0, 1), "relative")


def test_trust_model_takes_the_scenarios_lam_unless_told():
    scenario = make_scenario("paper-3x3").change(lam=0.7)
    assert parse_trust_model("role-trust", scenario).lam == 0.7
    assert parse_trust_model("role-trust:lam=0.6", scenario).lam == 0.6


def test_students_interval():
    for freedom, quantile in ((1, 12.706), (2, 4.303), (9, 2.262), (1000, 1.962)):
        assert student_95(freedom) == pytest.approx(quantile, abs=5e-4)
    mean, half, games = over_games(np.array([1.0, 2.0, np.nan, 3.0]))
    assert (mean, games) == (2.0, 3)
    assert half == pytest.approx(4.303 / 3**0.5, abs=1e-3)
