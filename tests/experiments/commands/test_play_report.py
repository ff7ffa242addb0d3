import json
from unittest.mock import ANY

import numpy as np
import pytest
from command_line import TINY, play, run

from roletrust_baselines import BadMouthing
from roletrust_env import Game, JointPolicy, make_scenario, metrics
from roletrust_env.evaluation.curves import Curves, record_curves
from roletrust_env.evaluation.groups import under_attack
from roletrust_env.metrics.confidence import over_games
from roletrust_env.world.roster import Roster


def test_metrics_of_an_attack_are_those_of_the_library(tmp_path):
    results, printed = play(
        tmp_path, "--games", "3", "--attack", "sr_2=bad-mouthing:start=4,stop=7"
    )
    found = results["measured"]["role-trust"]["metrics"]
    roles = ["AUC under the attack, sr", "AUC at the end, sr"]
    assert list(found) == [
        *roles,
        "false alarms",
        "utility",
        "utility, no attack",
        "recovery, rounds",
    ]
    for name in ("AUC, sr", "false alarms", "utility", "utility, no attack", "recovery, rounds"):
        assert f" {name} " in printed.replace("\n", " \n ")
    rules = make_scenario("paper-3x3").change(max_cycles=12)
    game = Game(rules)
    joint_policies = [
        JointPolicy(game, attackers) for attackers in ({"sr_2": BadMouthing(start=4, stop=7)}, {})
    ]
    curves, twin = (record_curves(joint_policy, 0, games=3) for joint_policy in joint_policies)
    scores = {
        "AUC under the attack, sr": metrics.auc(curves.trust[4:7, :3].mean(axis=0), [2]),
        "AUC at the end, sr": metrics.auc(curves.trust[-1, :3], [2]),
        "false alarms": metrics.false_alarms(curves.trust, [0, 1, 3, 4, 5]),
        "utility": metrics.utility(curves.top, curves.offered),
        "utility, no attack": metrics.utility(twin.top, twin.offered),
        "recovery, rounds": metrics.recovery(curves.trust, twin.trust, [0, 1, 3, 4, 5], 7),
    }
    for name, score in scores.items():
        assert found[name]["mean"] == pytest.approx(score.value.mean())
        assert found[name]["half_95"] == pytest.approx(over_games(score.value).half)


@pytest.mark.parametrize(
    ("window", "undefined"),
    [
        ("start=4", {"recovery, rounds": "the attack lasts to the end"}),
        ("start=11,stop=12", {"recovery, rounds": "the attack lasts to the end"}),
        (
            "start=40,stop=50",
            dict.fromkeys(
                ["AUC under the attack, sp", "recovery, rounds"], "the attack never began"
            ),
        ),
    ],
)
def test_what_is_undefined_is_null_with_the_reason(tmp_path, window, undefined):
    results, printed = play(tmp_path, "--attack", f"sp_0=on-off:{window}")
    found = results["measured"]["role-trust"]["metrics"]
    assert {
        name: value["why"] for name, value in found.items() if value["mean"] is None
    } == undefined
    for name, why in undefined.items():
        assert f"{name}: undefined: {why}" in printed.replace("\n", " ")


def test_detection_is_that_of_the_attack_s_own_rounds_and_of_the_end():
    roster = Roster.of(make_scenario("paper-3x3"))
    curves = Curves(*[np.ones((6, n, 1)) for n in (1, 3, 3, 6, 6, 3)])
    curves.trust[1:3, 0] = 0.9  # found out while it attacks,
    curves.trust[3:, 1:3] = 0.2  # and believed more than the others afterwards
    found = under_attack(roster, curves, None, {"sr_0": BadMouthing(start=1, stop=3)})
    assert found["AUC under the attack, sr"].mean == 1
    assert found["AUC at the end, sr"].mean == 0
    assert found["false alarms"].mean == 2 * 3 / (5 * 6)


def test_undefined_in_some_games_only():
    roster = Roster.of(make_scenario("paper-3x3"))
    full = Curves(*[np.ones((6, n, 2)) for n in (1, 3, 3, 6, 6, 3)])
    trust = full.trust.copy()
    trust[3:, :, 1] = 0.2  # in the second game trust is not back
    found = under_attack(roster, full._replace(trust=trust), full, {"sr_0": BadMouthing(stop=3)})
    assert found["recovery, rounds"].mean == 0
    assert (
        found["recovery, rounds"].why
        == "trust did not recover before the game ended, in 1 of 2 games"
    )
    everybody = dict.fromkeys(roster.names[:3], BadMouthing())
    assert (
        "no honest agents" in under_attack(roster, full, None, everybody)["AUC at the end, sr"].why
    )
    assert "live camera" in under_attack(roster, full, None, everybody)["utility, no attack"].why


def test_of_raters_that_a_model_does_not_judge_nothing_is_said(tmp_path):
    """Its trust in them reads 1 whatever they do: in a mean over all it would hide harm."""
    results, printed = play(
        tmp_path, "--model", "mean", "--games", "2", "--attack", "sr_2=bad-mouthing:stop=9"
    )
    found = results["measured"]["mean"]
    why = "the model has no trust in raters"
    unjudged = [
        found["damage"]["2 sr"],
        found["damage"]["all 5 honest"],
        found["groups"]["2 sr, honest"]["mean trust"],
    ]
    unjudged += [
        found["metrics"][name] for name in ("AUC under the attack, sr", "AUC at the end, sr")
    ]
    assert unjudged == [{"mean": None, "half_95": None, "why": why}] * 5
    assert found["groups"]["2 sr, honest"]["present at the end"]["mean"] == 2
    assert found["damage"]["3 sp"]["mean"] > 0.1
    with_raters = Curves(*[np.ones((6, n, 1)) for n in (1, 3, 3, 6, 6, 3)])
    with_raters.trust[:, 3:] = 0.2
    roster = Roster.of(make_scenario("paper-3x3"))
    for rates_raters, alarms in ((True, 3 / 5), (False, 1.0)):
        score = under_attack(roster, with_raters, None, {"sr_0": BadMouthing()}, rates_raters)[
            "false alarms"
        ]
        assert score.mean == pytest.approx(alarms)
    assert "no trust in raters: mean: false alarms and recovery are of providers only" in " ".join(
        printed.split()
    )


def test_json_is_all_that_is_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = ["play", *TINY, "--attack", "sr_0=bad-mouthing", "--games", "2", "--json"]
    alone = run(*asked)
    assert (alone.exit_code, list(tmp_path.iterdir())) == (0, [])
    kept = run(*asked, "--out", "out")
    assert kept.exit_code == 0
    assert "Written to out" in kept.stderr
    assert (
        json.loads(alone.stdout)
        == json.loads(kept.stdout)
        == json.loads((tmp_path / "out/results.json").read_text())
    )


def test_an_interrupt_of_a_video_is_one_line_and_keeps_the_results(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("roletrust_experiments.plots.video.write_video", interrupted)
    stopped = run("play", *TINY, "--video", "--out", tmp_path)
    assert (stopped.exit_code, stopped.stderr) == (130, ANY)
    assert (tmp_path / "results.json").is_file()
