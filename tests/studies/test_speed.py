import csv
import json
from functools import partial

import pytest
import typer
from typer.testing import CliRunner

from studies import speed as speed_module
from studies.speed import Plan, Target, speed
from studies.timing import contestants as timing
from studies.timing import edges
from studies.timing.contestants import Contestant, Spread, Timing, measure

pytestmark = pytest.mark.slow

TINY = Plan(batches=(4,), compiled=(), sides=(3, 5), repeats=3, slice_s=0.001, edges=(200,), stream=50)


def a_timing(*seconds, games=1, agents=1, ratings=0):
    return Timing(Contestant("x", games, agents, lambda: None, ratings), seconds)


def run(monkeypatch, *arguments, plan=TINY):
    monkeypatch.setattr(speed_module, "QUICK", plan)
    app = typer.Typer()
    app.command()(speed)
    return CliRunner().invoke(app, ["--quick", *arguments], env={"COLUMNS": "100"})


def test_the_command_prints_its_tables_and_writes_its_files(monkeypatch, tmp_path):
    result = run(monkeypatch, "--seed", "3", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    for words in ("Steps per second", "one environment", "NumPy batch", "torch batch", "Time per rating", "5 x 5"):
        assert words in result.output
    with (tmp_path / "speed.csv").open() as file:
        rows = list(csv.DictReader(file))
    names = [row["name"] for row in rows]
    assert names[0] == "one environment"
    first = names.index("trust model")
    assert names[first : first + 4] == ["trust model", "whole round"] * 2
    assert names[first + 4 :] == [made.contestant.name for made in edges.rounds(edges.Edges.of(200, 3))] + [
        f"stream in batches of {batch}" for batch in ("100", "1,000", "10,000")
    ]
    for row in rows:
        assert float(row["step_us_least"]) <= float(row["step_us"]) <= float(row["step_us_greatest"])
        games, agents, step_s = int(row["games"]), int(row["agents"]), float(row["step_us"]) / 1e6
        assert float(row["agent_steps_per_s"]) == pytest.approx(games * agents / step_s, rel=1e-3)
    assert [row["ratings"] for row in rows[first : first + 4]] == ["9", "9", "25", "25"]
    assert [row["ratings"] for row in rows[-3:]] == ["100", "1000", "10000"]
    last = rows[first + 3]
    assert float(last["ns_per_rating"]) == pytest.approx(float(last["step_us"]) * 1e3 / 25, rel=1e-3)
    about = json.loads((tmp_path / "speed.json").read_text())
    assert about["seed"] == 3
    assert about["machine"]["cores"] >= 1
    assert about["torch_threads"] == 1
    assert {"numpy", "torch"} <= about["packages"].keys()
    assert [t["bound"] for t in about["targets"]] == [1, 7, 12, 20, 1.5, 2]
    assert about["copied_bytes_per_s"] > 1e8
    assert all(peak["bytes"] > 8 * 4 * 150 for peak in about["peak_memory"])


def test_a_peer_that_is_not_installed_is_named_and_not_promised(monkeypatch):
    find_spec = speed_module.importlib.util.find_spec
    absent = {"mpe2", "vmas"}
    monkeypatch.setattr(
        speed_module.importlib.util, "find_spec", lambda name: None if name in absent else find_spec(name)
    )
    output = run(monkeypatch).output
    assert "mpe2 is not installed" in output
    assert "vmas is not installed" in output
    assert "role-trust on edges" in output
    assert output.count("not measured") == 8  # six promises and two reasons


def test_what_cannot_be_made_is_named(monkeypatch):
    def fail(*_):
        raise RuntimeError("no C++ compiler\nand a long story")

    monkeypatch.setattr(timing, "batch", fail)
    output = run(monkeypatch).output
    assert "torch: no C++ compiler" in output
    assert "long story" not in output


@pytest.mark.parametrize(
    "make",
    [
        timing.one_environment,
        timing.simple_adversary,
        partial(timing.batch, "NumPy", 5),
        partial(timing.batch, "torch", 5),
        partial(timing.whole_round, 4),
    ],
)
def test_contestants_play_on_past_the_end_of_an_episode(make):
    pytest.importorskip("mpe2")
    contestant = make(0)
    for _ in range(250):  # an episode has 240 rounds
        contestant.step()


def test_every_contestant_gets_its_turns():
    taken, turns = [], []
    contestants = [Contestant(name, 1, 1, partial(taken.append, name)) for name in "ab"]
    timings = measure(contestants, repeats=3, slice_s=1e-9, advance=lambda: turns.append(len(taken)))
    assert [len(t.seconds) for t in timings] == [3, 3]
    assert taken[-6:] == ["a", "b"] * 3
    assert len(turns) == 6


def test_rates_and_ratios():
    ours = a_timing(1.0, 2.0, 4.0, games=10, agents=6)
    assert ours.env_steps() == Spread(5, 2.5, 10)
    assert ours.agent_steps() == Spread(30, 15, 60)
    peer = a_timing(1.0, 2.0, 8.0, games=10, agents=3)
    assert ours.times_faster(peer) == Spread(2, 2, 4)
    large, small = a_timing(9.0, 9.0, ratings=9), a_timing(2.0, 4.0, ratings=4)
    assert large.per_rating() == Spread(1, 1, 1)
    assert large.times_dearer(small) == Spread(1.5, 1, 2)


@pytest.mark.parametrize(
    ("found", "at_least", "ok"),
    [(4.1, True, True), (3.9, True, False), (4.1, False, False), (3.9, False, True), (None, True, None)],
)
def test_the_median_decides(found, at_least, ok):
    spread = None if found is None else Spread(found, 0, 99)
    assert Target("", 4.0, at_least, spread).ok is ok
