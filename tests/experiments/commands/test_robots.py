"""`roletrust robots`, as far as it goes without processes of its own."""

import json
import stat

import imageio.v2 as imageio
import numpy as np
import pytest
from command_line import printed, run
from manager_cases import feed, manager, random_ratings
from refusals import assert_names

from roletrust_env.evaluation.curves import Curves
from roletrust_manager.journal.lines import read_journal
from roletrust_manager.robots import demo


def test_keys_are_made_once(tmp_path):
    assert "sr_0, sr_1, sr_2" in run("robots", "keys", tmp_path / "keys").output
    assert stat.S_IMODE((tmp_path / "keys" / "sr_1.key").stat().st_mode) == 0o600
    again = run("robots", "keys", tmp_path / "keys", "sr_1", "sr_7").output
    assert "Unchanged: sr_1" in again
    assert (tmp_path / "keys" / "sr_7.pub").exists()
    assert (tmp_path / "keys" / "manager.key").exists()
    assert (tmp_path / "keys" / "sp_2.key").exists()


def test_a_public_key_is_replaced_on_demand_only(tmp_path):
    run("robots", "keys", tmp_path / "keys", "sr_0")
    (tmp_path / "keys" / "sr_0.key").unlink()
    before = (tmp_path / "keys" / "sr_0.pub").read_bytes()
    refused = run("robots", "keys", tmp_path / "keys", "sr_1", "sr_0")
    assert refused.exit_code == 2
    assert_names(" ".join(refused.stderr.split()), "sr_0")
    assert [path.name for path in (tmp_path / "keys").iterdir()] == ["sr_0.pub"]
    assert (tmp_path / "keys" / "sr_0.pub").read_bytes() == before
    assert "Made" in run("robots", "keys", tmp_path / "keys", "sr_0", "--replace").output
    assert (tmp_path / "keys" / "sr_0.pub").read_bytes() != before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["agent", "sp_9"], ("sp_9", "sr_0", "sr_1")),
        (["agent", "sp_0", "--role", "rater"], ("sp_0", "sr_0", "sr_1")),
        (["agent", "srsp_0", "--set", "scenario=robots-that-move"], ("srsp_0", "provider")),
        (["agent", "sp_0", "--frames", "no.mp4"], ("no.mp4",)),
        (["agent", "sr_0", "--frames", "no.mp4"], ("frames", "sr_0")),
        (["agent", "sp_0", "--attack", "bad-mouthing"], ("sp_0", "bad-mouthing")),
        (["agent", "sp_0", "--attack", "conflicting"], ("sp_0", "conflicting")),
        (["agent", "sr_0", "--keys", "nowhere"], ("nowhere",)),
        (["agent", "sr_0", "--attack", "nonsense"], ("nonsense",)),
        (["agent", "sr_0", "--set", "speed=0.05"], ("speed", "0.05")),
        (["agent", "sr_0", "--set", "seed=-1"], ("seed", "-1")),
        (["agent", "sr_0", "--set", "network=7"], ("network", "7")),
        (["agent", "sr_0", "--set", "sped=2"], ("sped", "speed")),
        (["manager", "j", "--keys", "nowhere"], ("nowhere",)),
        (["manager", "j", "--model", "nonsense"], ("nonsense",)),
        (["manager", "j", "--set", "speed=fast"], ("speed", "fast")),
        (["view", "--set", "port=65536"], ("port", "65536")),
        (["record", "bag", "--set", "images=7"], ("images", "7")),
        (["keys", "keys", "../sr_0"], ("../sr_0",)),
        (["demo", "--set", "speed=30"], ("speed", "30")),
        (["demo", "--set", "seed=x"], ("seed", "x")),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_cannot_be_is_said_in_one_line(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run("robots", *arguments)
    assert done.exit_code == 2, done.output
    assert_names(" ".join(done.stderr.split()), *words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("drawn")
def test_a_demo_writes_its_figure_and_its_numbers(tmp_path, monkeypatch):
    keeper = manager(tmp_path / "journal.jsonl")
    feed(keeper, *random_ratings(demo.SCENARIO.max_cycles))
    keeper.close()
    rounds = list(read_journal(tmp_path / "journal.jsonl"))
    half = np.full((len(rounds), 3, 1), 0.5)
    time_s = demo.SCENARIO.period_s * np.arange(1, len(rounds) + 1)
    curves = Curves(time_s, half, half, np.tile(half, (1, 2, 1)), np.tile(half, (1, 2, 1)), half)
    given = {}

    def run_demo(out, policies, **arguments):
        given.update(arguments)
        return demo.DemoResult(0.5, rounds, curves, curves)

    monkeypatch.setattr(demo, "run_demo", run_demo)
    options = "--attack", "on-off", "--set", "seed=3", "--set", "speed=2", "--no-view"
    printed("robots", "demo", *options, "--out", tmp_path)
    assert (given["speed"], given["seed"], given["view"]) == (2, 3, False)
    results = json.loads((tmp_path / "results.json").read_text())
    assert results["attack"] == "on-off"
    assert (results["speed"], results["seed"]) == (0.5, 3)
    assert results["rounds"] == len(rounds)
    assert {claim["figure"] for claim in results["claims"]["measured"]} == {3}
    assert imageio.imread(tmp_path / "figure.png").shape[1] > 1500
    for name in results["files"][:2]:
        assert len(np.genfromtxt(tmp_path / name, delimiter=",", names=True)) == len(rounds)
