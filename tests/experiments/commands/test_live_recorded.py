"""What a recording becomes: a scenario."""

import tomllib

import pytest
from command_line import printed, run
from manager_cases import TEAM, manager
from recorded_games import PERIOD, spoken
from refusals import assert_names

from roletrust_baselines import BadMouthing
from roletrust_env import make_scenario
from roletrust_env.storage.scenario_files import write_scenario
from roletrust_env.world.presets import scenarios
from roletrust_experiments import commands
from roletrust_manager.admission.keys import Signer, make_keys
from roletrust_manager.admission.validation import MANAGER
from roletrust_manager.dds.nodes.manager_node import replay_recording
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.recording import RecordedMessage, Recorder


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """The paper's Figure 4, with what the manager published; in a game, a service is rated in the
    round after it."""
    folder = tmp_path_factory.mktemp("recorded")
    said = spoken(make_scenario("paper-3x3"), attackers={"sr_2": BadMouthing(start=41, stop=91)})
    keeper = manager(folder / "journal")
    for name in TEAM.providers:
        keeper.add_provider(name, 0)
    trust = [
        RecordedMessage(
            entry.closed, "/trust", messages.TRUST, messages.encode(messages.trust_message(entry))
        )
        for entry in replay_recording(said, keeper, PERIOD)
    ]
    with Recorder(folder / "bag") as recorder:
        for message in sorted([*said, *trust]):
            recorder.write(message)
    return folder / "bag"


def test_a_scenario_of_a_recording_is_played_and_trained_against(bag, tmp_path):
    made = printed("live", "scenario", bag, "--out", tmp_path / "team.toml")
    for said in ("noise of sr_2", "ratings that did not count", "239 rounds"):
        assert said in made
    scenario = make_scenario(tmp_path / "team.toml")
    assert (scenario.name, scenario.max_cycles, len(scenario.agents)) == ("team", 239, 6)
    assert "# sr_2" in (tmp_path / "team.toml").read_text()
    attacked = [
        "--attack",
        "sr_0=bad-mouthing",
        "--set",
        "max_cycles=20",
        "--out",
        str(tmp_path / "play"),
    ]
    assert run("play", str(tmp_path / "team.toml"), *attacked).exit_code == 0
    settings = [
        "--set",
        "max_cycles=10",
        "--learner",
        "PPO:games=8,hidden=[8],batch_size=40,n_steps=10,n_epochs=1",
    ]
    settings += [
        "--scenario",
        str(tmp_path / "team.toml"),
        "--steps",
        "160",
        "--out",
        str(tmp_path / "train"),
    ]
    printed("train", "RaterAttack", *settings)


def test_what_reads_a_recording_says_how_far_it_is(bag, tmp_path, monkeypatch):
    monkeypatch.setattr(commands.console, "_PERIOD", 0.0)
    for arguments, stages in (
        (
            ["scenario", str(bag), "--out", str(tmp_path / "team.toml")],
            ("Reading bag", "Matching ratings"),
        ),
        (["manager", str(tmp_path / "journal"), "--recording", str(bag)], ("Playing bag",)),
    ):
        lines = run("live", *arguments).output.splitlines()
        for stage in stages:
            shares = [
                line.removeprefix(stage).split()[0] for line in lines if line.startswith(stage)
            ]
            assert len(shares) > 100, lines
            assert shares[-1] == "100%"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["live", "scenario", "nowhere"], ("nowhere",)),
        (["live", "scenario", "nowhere", "--out", "team.txt"], (".toml",)),
        (["live", "scenario", "nowhere", "--out", "there.toml"], ("there.toml",)),
        (
            ["live", "demo", "--seconds", "30"],
            ("seconds", "30", "bad-mouthing"),
        ),
    ],
)
def test_what_cannot_be_is_said_in_one_line(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.toml").write_text("name = 'mine'")
    done = run(*arguments)
    assert done.exit_code == 2, done.output
    assert_names(" ".join(done.stderr.split()), *words)
    assert [path.name for path in tmp_path.iterdir()] == ["there.toml"]
    assert (tmp_path / "there.toml").read_text() == "name = 'mine'"


@pytest.mark.parametrize("name", sorted(scenarios()))
def test_any_scenario_is_written_and_read_as_it_was(name, tmp_path):
    scenario = make_scenario(name).change(description='a "quoted" \\ name\n\x7f')
    write_scenario(tmp_path / "again.toml", scenario)
    assert make_scenario(tmp_path / "again.toml") == scenario
    assert tomllib.loads((tmp_path / "again.toml").read_text())["name"] == name


def said(rater, round, row, stamp=None):
    moment = PERIOD * (1000 + round)
    raw = messages.encode(messages.ratings_message(rater, moment if stamp is None else stamp, row))
    return RecordedMessage(moment + 5, f"/{rater}/ratings", messages.RATINGS, raw)


def recorded(path, said):
    with Recorder(path) as recorder:
        for message in said:
            recorder.write(message)
    return str(path)


def test_names_that_are_anything_are_written_and_shown(tmp_path):
    names = "sp_0", "x\nrole = 'no'", "[/]", "\x1b]0;mine\x07", "\x7f"
    row = {name: 0.1 + k / 10 for k, name in enumerate(names)}
    bag = recorded(tmp_path / "bag", [said(f"sr_{i}", r, row) for r in range(12) for i in range(3)])
    done = printed("live", "scenario", bag, "--out", tmp_path / "team.toml")
    assert "ability of [/]" in done
    assert "\x1b]" not in done
    assert len(make_scenario(tmp_path / "team.toml").agents) == 8


@pytest.mark.parametrize("stamp", [0, 10**18])
def test_a_stamp_of_another_time_makes_no_scenario_longer(stamp, tmp_path):
    usual = [said(f"sr_{i}", r, {"sp_0": 0.5}) for r in range(12) for i in range(3)]
    bag = recorded(tmp_path / "bag", [*usual, said("sr_1", 13, {"sp_0": 0.5}, stamp)])
    printed("live", "scenario", bag, "--out", tmp_path / "team.toml")
    assert make_scenario(tmp_path / "team.toml").max_cycles == 12


def test_who_has_no_key_is_in_no_scenario_of_a_team_with_keys(tmp_path):
    make_keys(tmp_path / "keys", ["sr_0", "sr_1"])
    unsigned = [said(name, r, {"sp_0": 0.5}) for r in range(12) for name in ("sr_0", "mallory")]
    asked = [
        recorded(tmp_path / "bag", unsigned),
        "--keys",
        str(tmp_path / "keys"),
        "--out",
        str(tmp_path / "a.toml"),
    ]
    done = run("live", "scenario", *asked)
    assert done.exit_code == 2
    assert_names(done.stderr, "recording")


def test_a_recording_of_too_little_is_refused_in_one_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(
        "live", "scenario", recorded(tmp_path / "bag", [said("sr_0", r, {}) for r in range(5)])
    )
    assert done.exit_code == 2, done.output
    assert_names(" ".join(done.stderr.split()), "stamp")
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_a_replay_of_nothing_leaves_nothing(tmp_path):
    printed("live", "manager", tmp_path / "journal", "--recording", tmp_path / "nowhere", code=2)
    assert list(tmp_path.iterdir()) == []


def test_unsigned_ratings_and_pictures_of_a_team_with_keys_are_ignored(tmp_path):
    make_keys(tmp_path / "keys", [MANAGER, "sr_0", "sr_1", "sp_0"])
    keys = ["--keys", str(tmp_path / "keys")]
    signed, shade = [], b"no picture is looked at"
    for r in range(12):
        moment = PERIOD * (1000 + r)
        for name in ("sr_0", "sr_1"):
            message = messages.ratings_message(
                name, moment, {"sp_0": 0.5}, Signer(tmp_path / "keys", name)
            )
            signed.append(
                RecordedMessage(
                    moment + 5, f"/{name}/ratings", messages.RATINGS, messages.encode(message)
                )
            )
        for name, signer in (("sp_0", Signer(tmp_path / "keys", "sp_0")), ("z0", None)):
            picture = messages.encode(messages.picture_message(moment, name, shade, signer))
            signed.append(
                RecordedMessage(
                    moment + 5, f"/{name}/image_raw/compressed", messages.IMAGE, picture
                )
            )
    own = recorded(tmp_path / "own", signed)
    assert run("live", "scenario", own, *keys, "--out", str(tmp_path / "own.toml")).exit_code == 0
    assert "z0" not in (tmp_path / "own.toml").read_text()
    assert run("live", "scenario", own, "--out", str(tmp_path / "all.toml")).exit_code == 0
    assert "z0" in (tmp_path / "all.toml").read_text()
