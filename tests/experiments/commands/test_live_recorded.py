"""What a recording becomes: figures, and a scenario."""

import json
import tomllib

import imageio.v2 as imageio
import numpy as np
import pytest
from command_line import run
from manager_cases import TEAM, manager
from recorded_games import PERIOD, spoken

from baselines import BadMouthing
from experiments.results.scenarios import write_scenario
from roletrust_env import make_scenario
from roletrust_env.live.nodes.manage import replay
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.recording import Recorded, Recorder
from roletrust_env.world.presets import scenarios


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """The paper's Figure 4, with what the manager published; in a game, a service is rated in the round after it."""
    folder = tmp_path_factory.mktemp("recorded")
    said = spoken(make_scenario("paper-3x3"), attackers={"sr_2": BadMouthing(start=41, stop=91)})
    keeper = manager(folder / "journal")
    for name in TEAM.providers:
        keeper.meet(name)
    trust = [
        Recorded(entry.closed, "/trust", messages.TRUST, messages.encode(messages.trust_message(entry)))
        for entry in replay(said, keeper, PERIOD)
    ]
    with Recorder(folder / "bag") as recorder:
        for message in sorted([*said, *trust]):
            recorder.write(message)
    return folder / "bag"


def test_the_papers_figure_from_a_recording(bag, tmp_path):
    done = run("figures", "--recording", str(bag), "--attack", "bad-mouthing", "--out", str(tmp_path))
    assert done.exit_code == 0, done.output
    results = json.loads((tmp_path / "results.json").read_text())
    assert results["period_s"] == 0.5
    assert all(claim["ok"] for claim in results["claims"])
    rows = np.genfromtxt(tmp_path / "figure4.csv", delimiter=",", names=True)
    assert rows["ToR_3"][70:88].mean() == pytest.approx(1 - np.sqrt(1 / 3), abs=0.06)
    assert imageio.imread(tmp_path / "figure4.png").shape[0] > 500


def test_the_curves_of_any_team(bag, tmp_path):
    done = run("figures", "--recording", str(bag), "--out", str(tmp_path))
    assert done.exit_code == 0, done.output
    rows = np.genfromtxt(tmp_path / "figure.csv", delimiter=",", names=True)
    assert rows.dtype.names == ("time_s", "ToR_sr_0", "ToR_sr_1", "ToR_sr_2", "ToP_sp_0", "ToP_sp_1", "ToP_sp_2")
    assert len(rows) == 239
    assert imageio.imread(tmp_path / "figure.png").shape[0] > 500


def test_a_scenario_of_a_recording_is_played_and_trained_against(bag, tmp_path):
    made = run("live", "scenario", str(bag), "--out", str(tmp_path / "team.toml"))
    assert made.exit_code == 0, made.output
    for said in ("noise of sr_2", "ratings that did not count", "239 rounds"):
        assert said in made.output
    scenario = make_scenario(tmp_path / "team.toml")
    assert (scenario.name, scenario.max_cycles, len(scenario.agents)) == ("team", 239, 6)
    assert "# sr_2" in (tmp_path / "team.toml").read_text()
    attacked = ["--attack", "sr_0=bad-mouthing", "--out", str(tmp_path / "play")]
    assert run("play", str(tmp_path / "team.toml"), *attacked).exit_code == 0
    small = ["max_cycles=10", "games=8", "hidden=[8]", "batch_size=40", "n_steps=10", "n_epochs=1"]
    settings = [text for k, setting in enumerate(small) for text in ("--learner" if k else "--set", setting)]
    settings += ["--scenario", str(tmp_path / "team.toml"), "--steps", "160", "--out", str(tmp_path / "train")]
    trained = run("train", "RaterAttack", *settings)
    assert trained.exit_code == 0, trained.output


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["figures", "--recording", "nowhere"], "nowhere cannot be read"),
        (["figures", "--recording", "nowhere", "--frames", "walk.mp4"], "--recording plays nothing"),
        (["figures", "--attack", "on-off"], "--attack is what was played in a --recording"),
        (["live", "scenario", "nowhere"], "nowhere cannot be read"),
        (["live", "scenario", "nowhere", "--out", "team.txt"], "must end in .toml"),
        (["live", "scenario", "nowhere", "--out", "there.toml"], "there.toml is there already"),
        (["live", "demo", "--seconds", "30"], "seconds is 30; with bad-mouthing it must be from 40 to 120"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(arguments, reason, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.toml").write_text("name = 'mine'")
    done = run(*arguments)
    assert done.exit_code == 2, done.output
    assert reason in " ".join(done.stderr.split())
    assert [path.name for path in tmp_path.iterdir()] == ["there.toml"]
    assert (tmp_path / "there.toml").read_text() == "name = 'mine'"


@pytest.mark.parametrize("name", sorted(scenarios()))
def test_any_scenario_is_written_and_read_as_it_was(name, tmp_path):
    scenario = make_scenario(name).change(description='a "quoted" \\ name\n\x7f')
    write_scenario(tmp_path / "again.toml", scenario)
    assert make_scenario(tmp_path / "again.toml") == scenario
    assert tomllib.loads((tmp_path / "again.toml").read_text())["name"] == name
