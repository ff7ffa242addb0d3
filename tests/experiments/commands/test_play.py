import json

import numpy as np
import pytest
from command_line import TINY, play, printed, run
from csv_files import csv_rows
from refusals import assert_names, refuses

from roletrust_baselines import BadMouthing
from roletrust_env import Game, __version__, make_scenario
from roletrust_env.evaluation.curves import Curves
from roletrust_env.evaluation.games import play as play_games
from roletrust_env.evaluation.groups import MEASURES, damage, measured_since
from roletrust_env.metrics.confidence import over_games, student_quantile
from roletrust_env.world.roster import Roster
from roletrust_experiments.plots.curves import curve_figure


def test_one_game_with_two_attackers(tmp_path, drawn):
    attacks = [
        "--attack",
        "sp_2=on-off:start=3,period=4",
        "--attack",
        "sr_1=bad-mouthing:level=0.2,targets=[0,1]",
    ]
    results, printed = play(tmp_path, *attacks)
    assert results["attackers"]["sp_2"]["parameters"]["period"] == 4
    assert results["attackers"]["sr_1"]["parameters"]["targets"] == [0, 1]
    assert results["scenario"]["max_cycles"] == 12
    measured = results["measured"]["role-trust"]
    assert measured["groups"]["sp_2, on-off"]["mean trust"]["half_95"] is None
    assert measured["damage"]["all 4 honest"]["mean"] > 0.05
    assert "sp_2, on-off" in printed
    assert "damage, 2 sp" in printed
    rows = csv_rows(tmp_path / "curves.csv")
    assert len(rows) == 12 * 6
    assert ",".join(rows[0].values()) == "role-trust,0.500000,sr_0,ToR,0.500000,,,1"
    assert (tmp_path / "curves.png").stat().st_size > 1000
    assert not list(tmp_path.glob(".*"))


def test_several_games_have_intervals(tmp_path):
    results, printed = play(tmp_path, "--games", "3")
    assert "±" in printed
    for measures in results["measured"]["role-trust"]["groups"].values():
        assert all(measures[name]["half_95"] is not None for name in MEASURES)
    assert results["measured"]["role-trust"]["damage"] == {}  # nobody attacks


def test_seed_decides(tmp_path):
    curves = []
    for i, seed in enumerate((1, 1, 2)):
        play(tmp_path / str(i), "--seed", str(seed))
        curves.append((tmp_path / str(i) / "curves.csv").read_bytes())
    assert curves[0] == curves[1] != curves[2]


@pytest.mark.parametrize("name", ["crowd-10x10", "robots-that-move", "open-system", "peers"])
def test_every_kind_of_scenario(tmp_path, name):
    attack = {"peers": "srsp_8=on-off"}.get(name, "sr_?=bad-mouthing")
    results, _ = play(tmp_path, name, "--games", "2", "--attack", attack, "--model", "mean:lam=0.8")
    made = {
        "class": "roletrust_env.trust.models.central.means.Mean",
        "parameters": {"lam": 0.8, "initial": 0.5},
    }
    assert results["trust_models"] == {"mean:lam=0.8": made}


def test_models_are_compared_under_one_attack(tmp_path):
    models = ["--model", "role-trust", "--model", "mean"]
    results, printed = play(
        tmp_path, *models, "--games", "2", "--attack", "sr_0=bad-mouthing:level=0"
    )
    damages = [
        results["measured"][model]["damage"]["3 sp"]["mean"] for model in ("role-trust", "mean")
    ]
    assert damages[0] != damages[1]
    assert min(damages) > 0.1
    assert printed.count("damage, 3 sp") == 2
    assert (tmp_path / "curves-role-trust.png").exists()
    assert (tmp_path / "curves-mean.png").exists()
    assert {row["trust_model"] for row in csv_rows(tmp_path / "curves.csv")} == {
        "role-trust",
        "mean",
    }


def test_who_is_cut_off_is_counted(tmp_path):
    cutting = [
        "--set",
        "admission={threshold=0.4, rounds=2}",
        "--attack",
        "sp_2=on-off:start=4,duty=1",
    ]
    results, printed = play(tmp_path, *cutting)
    groups = results["measured"]["role-trust"]["groups"]
    assert groups["sp_2, on-off"]["present at the end"]["mean"] == 0
    assert groups["2 sp, honest"]["present at the end"]["mean"] == 2
    assert "0/1" in printed
    assert "2/2" in printed


def test_attacker_that_plays_at_random_leaves_the_luck_of_the_game_alone(tmp_path):
    # Both its spells are good service: in the same luck nobody is harmed, to the last bit.
    harmless = "sp_2=on-off:switching=random,bad=1,good=1"
    results, _ = play(tmp_path, "--games", "3", "--attack", harmless)
    assert results["measured"]["role-trust"]["damage"]["all 5 honest"] == {"mean": 0, "half_95": 0}


def test_damage_counts_who_is_gone_with_the_last_trust():
    roster = Roster.of(make_scenario("paper-3x3"))
    twin = Curves(*[np.ones((4, 6, 1))] * 6)
    trust = twin.trust.copy()
    trust[1, 5], trust[2:, 5] = 0.2, np.nan  # sp_2 is cut off
    lost = damage(roster, twin._replace(trust=trust), twin, {"sr_0": BadMouthing()})
    assert lost["3 sp"].mean == pytest.approx(0.8 * 3 / 12)
    assert lost["2 sr"].mean == 0


def test_lowest_trust_is_that_under_the_attack():
    assert measured_since({}, 100) == 10
    assert measured_since({}, 12) == 6
    assert measured_since({"sr_0": BadMouthing(start=50), "sr_1": BadMouthing(start=40)}, 100) == 40
    assert measured_since({"sr_0": BadMouthing(start=500)}, 100) == 10


def test_default_folder_says_what_was_played(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("play", *TINY, "--attack", "sr_[01]=bad-mouthing").exit_code == 0
    assert (tmp_path / "results/play/paper-3x3-role-trust-bad-mouthing-x2/curves.png").exists()


def test_the_function_plays_what_its_command_writes(tmp_path):
    options = ["--attack", "sr_0=bad-mouthing:start=3", "--games", "2", "--model", "mean"]
    written, printed = play(tmp_path, *options)
    results = play_games(
        attacks=["sr_0=bad-mouthing:start=3"], games=2, model="mean", max_cycles=12
    )
    assert results.data() == written
    for cell in (cell for row in results.table()[1] for cell in row if "±" in cell):
        assert cell in printed
        assert cell in results._repr_markdown_()


def test_policies_are_attacks_too():
    liar = BadMouthing(start=3)
    results = play_games(attacks={"sr_0": liar}, max_cycles=12)
    for text in ("sr_0=bad-mouthing:start=3", ["sr_0=bad-mouthing:start=3"]):
        assert results.data() == play_games(attacks=text, max_cycles=12).data()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"games": 0}, ("games", 0)),
        ({"games": 2.5}, ("games", 2.5)),
        ({"seed": -1}, ("seed", -1)),
        ({"model": []}, ("model",)),
        ({"model": ["mean", "mean"]}, ("mean",)),
        ({"lam": float("nan")}, ("lam", "nan")),
    ],
)
def test_the_function_refuses_what_is_not_allowed(arguments, words):
    with refuses(ValueError, *words):
        play_games(**arguments)


def test_own_model_and_attacker(tmp_path, monkeypatch):
    (tmp_path / "mine_for_test.py").write_text(
        "from roletrust_baselines import BadMouthing\nfrom roletrust_env.trust import Mean\n"
        "class Liar(BadMouthing): pass\n"
    )
    monkeypatch.chdir(tmp_path)
    own = ["--model", "mine_for_test:Mean:lam=0.9", "--attack", "sr_0=mine_for_test:Liar:level=0.1"]
    results, printed = play(tmp_path / "out", *own)
    assert results["trust_models"]["mine_for_test:Mean:lam=0.9"]["parameters"]["lam"] == 0.9
    assert results["attackers"]["sr_0"]["class"] == "mine_for_test.Liar"
    assert "sr_0, liar" in printed


@pytest.mark.parametrize(
    ("games", "absent", "said"), [(1, 8, "gone"), (4, 30, "in 0 of 4 games"), (4, 0, None)]
)
def test_curves_tell_who_is_gone(games, absent, said):
    game = Game(make_scenario("paper-3x3").change(max_cycles=60))
    full = Curves(np.arange(1, 61) / 2, *[np.full((60, n, games), 0.9) for n in (3, 3, 6, 6, 3)])
    full.top[60 - absent :, 2] = np.nan
    if games > 1:
        full.top[20:, 1, :3] = np.nan  # three of four games
    figure = curve_figure("title", game, full, {"sp_2": BadMouthing()})
    labels = [text.get_text() for text in figure.axes[1].get_legend().get_texts()]
    assert (said in labels[0]) if said else (labels[0] == "sp_2 (attacker)")
    assert (figure.get_supxlabel().find("faint: more than half are absent") >= 0) == (games > 1)
    assert figure.axes[0].texts[0].get_text() == "attack"  # also from 0 on


def test_scenario_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('agents = [{role = "SR", count = 2}, {role = "SP"}]\n')
    results, _ = play(tmp_path / "out", str(path))
    assert results["scenario"]["name"] == "mine"


@pytest.mark.slow
def test_video(tmp_path):
    play(tmp_path, "--attack", "sp_0=on-off", "--video")
    import imageio.v2 as imageio

    with imageio.get_reader(tmp_path / "play.mp4") as film:
        assert film.count_frames() == 12
        assert np.ptp(film.get_data(5)) > 100


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], ("nowhere",)),
        (["nowhere.toml"], ("nowhere.toml",)),
        (["--model", "meen"], ("mean",)),
        (["--model", "mean:depth=3"], ("depth",)),
        (["--model", "mean:lam=2"], ("lam", "2")),
        (["--attack", "sp_0"], ("AGENT=NAME",)),
        (["--attack", "sp_0=onoff"], ("onoff",)),
        (["--attack", "sp_0=on-off:duty=7"], ("duty", "7")),
        (["--attack", "sp_0=on-off:duty=much"], ("duty", "much")),
        (["--attack", "sp_0=on-off:duty"], ("field=value",)),
        (["--attack", "sp_9=on-off"], ("sp_9",)),
        (["--attack", "xx_*=on-off"], ("xx_*",)),
        (["--attack", "sr_0=on-off"], ("sr_0", "on-off")),
        (["--attack", "sp_0=on-off", "--attack", "sp_*=on-off"], ("sp_0",)),
        (["--attack", "sr_0=bad-mouthing:targets=[7]"], ("7", "2")),
        (["--set", "lam=0.2"], ("lam", "0.2")),
        (["--set", "colour=blue"], ("colour",)),
        (["--set", "lam=0.6", "--set", "lam=0.7"], ("twice",)),
        (["--set", "max_cycle=9"], ("max_cycles",)),
        (
            ["--set", "lam=0.6", "--model", "role-trust:lam=0.8"],
            ("role-trust:lam=0.8", "--set lam=0.6"),
        ),
        (["--model", "mean", "--model", "mean"], ("model", "mean")),
        (["--model", "mine"], ("roletrust_env.trust_models",)),
        (["--model", "no_such:Mean"], ("no_such:Mean",)),
        (["--model", "roletrust_baselines:OnOff"], ("roletrust_baselines:OnOff", "TrustModel")),
        (["--attack", "sr_0=roletrust_env.trust:Mean"], ("roletrust_env.trust:Mean", "Policy")),
        (
            ["--attack", "sr_0=bad-mouthing:targets=[sp_0,sp_7]"],
            ("targets", "sp_7", "sp_0"),
        ),
    ],
)
def test_bad_input_is_one_clean_error_and_writes_nothing(tmp_path, arguments, words):
    result = run("play", *arguments, "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert_names(result.stderr, *words)
    assert "Traceback" not in result.output + result.stderr
    assert result.stderr.count("Error") == 1
    assert not (tmp_path / "out").exists()


def test_folder_that_is_a_file(tmp_path):
    (tmp_path / "out").write_text("in the way")
    result = run("play", *TINY, "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert str(tmp_path / "out") in result.stderr


def test_version_and_help():
    assert __version__ in run("--version").output
    for command in ("figures", "play", "list"):
        assert "Examples" in printed(command, "--help")


def test_students_interval():
    for freedom, quantile in ((1, 12.706), (2, 4.303), (9, 2.262), (1000, 1.962)):
        assert student_quantile(freedom) == pytest.approx(quantile, abs=5e-4)
    mean, half, games = over_games(np.array([1.0, 2.0, np.nan, 3.0]))
    assert (mean, games) == (2.0, 3)
    assert half == pytest.approx(4.303 / 3**0.5, abs=1e-3)


def test_identities_in_reserve_count_as_their_attackers(tmp_path):
    mine = tmp_path / "mine.toml"
    mine.write_text(
        'agents = [{role = "SR", count = 5}, {role = "SP", count = 3}, {role = "SP", reserve = 2}]'
    )
    short, out = ["--set", "max_cycles=30"], tmp_path / "out"
    for attack, seats in (("sp_*=on-off", 4), ("sp_3=whitewashing:reserve=2", 1)):
        printed("play", mine, "--attack", attack, "--games", "3", *short, "--out", out)
        results = json.loads((out / "results.json").read_text())
        assert len(results["attackers"]) == seats
    groups = results["measured"]["role-trust"]["groups"]
    assert {label: group["agents"] for label, group in groups.items()} == {
        "5 sr, honest": 5,
        "3 sp, honest": 3,
        "3 sp, whitewashing": 3,
    }
