"""`roletrust live`, as far as it goes without processes of its own."""

import itertools
import socket
import stat
from contextlib import nullcontext
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from command_line import printed, run
from manager_cases import PERIOD, TEAM, feed, manager, random_ratings, rating_message
from refusals import assert_names, refuses

from roletrust_experiments.commands import console
from roletrust_experiments.commands.console import progress_bar
from roletrust_experiments.commands.live import demo, pace
from roletrust_experiments.commands.live.demo import _latencies_ms, curves_from_rounds
from roletrust_experiments.commands.live.processes import NodeProcesses, _Process
from roletrust_manager.admission import clock
from roletrust_manager.dds.nodes.run_loop import Timeline
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.recording import RecordedMessage, Recorder
from roletrust_manager.journal.lines import read_journal


def test_keys_are_made_once(tmp_path):
    assert "sr_0, sr_1, sr_2" in run("live", "keys", tmp_path / "keys").output
    assert stat.S_IMODE((tmp_path / "keys" / "sr_1.key").stat().st_mode) == 0o600
    again = run("live", "keys", tmp_path / "keys", "sr_1", "sr_7").output
    assert "Unchanged: sr_1" in again
    assert (tmp_path / "keys" / "sr_7.pub").exists()
    assert (tmp_path / "keys" / "manager.key").exists()
    assert (tmp_path / "keys" / "sp_2.key").exists()


def test_a_public_key_is_replaced_on_demand_only(tmp_path):
    run("live", "keys", tmp_path / "keys", "sr_0")
    (tmp_path / "keys" / "sr_0.key").unlink()
    before = (tmp_path / "keys" / "sr_0.pub").read_bytes()
    refused = run("live", "keys", tmp_path / "keys", "sr_1", "sr_0")
    assert refused.exit_code == 2
    assert_names(" ".join(refused.stderr.split()), "sr_0")
    assert [path.name for path in (tmp_path / "keys").iterdir()] == ["sr_0.pub"]
    assert (tmp_path / "keys" / "sr_0.pub").read_bytes() == before
    assert "Made" in run("live", "keys", tmp_path / "keys", "sr_0", "--replace").output
    assert (tmp_path / "keys" / "sr_0.pub").read_bytes() != before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["agent", "sp_9"],
            ("sp_9", "sr_0", "sr_1"),
        ),
        (
            ["agent", "sp_0", "--role", "rater"],
            ("sp_0", "sr_0", "sr_1"),
        ),
        (["agent", "srsp_0", "--scenario", "robots-that-move"], ("srsp_0",)),
        (["agent", "sp_0", "--frames", "no.mp4"], ("no.mp4",)),
        (
            ["agent", "sr_0", "--frames", "no.mp4"],
            ("--frames", "--loop"),
        ),
        (
            ["agent", "sp_0", "--attack", "bad-mouthing"],
            ("sp_0", "bad-mouthing"),
        ),
        (
            ["agent", "sp_0", "--attack", "conflicting"],
            ("sp_0", "conflicting"),
        ),
        (["agent", "sr_0", "--keys", "nowhere"], ("nowhere",)),
        (["agent", "sr_0", "--attack", "nonsense"], ("nonsense",)),
        (["agent", "sp_0", "--start", "1800000000"], ("--start",)),
        (["agent", "sp_0", "--rounds", "99999999999999999999"], ("--rounds",)),
        (["manager", "j", "--keys", "nowhere"], ("nowhere",)),
        (["manager", "j", "--model", "nonsense"], ("nonsense",)),
        (["record", "saved", "--recover", "nowhere"], ("nowhere",)),
        (["keys", "keys", "../sr_0"], ("../sr_0",)),
        (["manager", "j", "--recording", "nowhere"], ("nowhere",)),
        (["demo", "--seconds", "30"], ("seconds", "30", "bad-mouthing")),
    ],
)
def test_what_cannot_be_is_said_in_one_line(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run("live", *arguments)
    assert done.exit_code == 2, done.output
    assert_names(" ".join(done.stderr.split()), *words)
    assert list(tmp_path.iterdir()) == []


def test_a_demo_without_its_port_leaves_the_last_ones_results(tmp_path):
    (tmp_path / "journal.jsonl").write_text("of the last")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        done = run("live", "demo", "--out", tmp_path, "--port", port, "--no-browser")
    assert done.exit_code == 2
    assert_names(done.stderr, port)
    assert (tmp_path / "journal.jsonl").read_text() == "of the last"


@pytest.mark.parametrize(
    ("work_s", "speed", "words"),
    [
        (0.19, 1.0, ()),
        (
            0.32,
            0.62,
            ("0.32", "0.2", "0.81", "--speed 0.62"),
        ),
        (
            2.1,
            None,
            ("2.1", "2", "--speed 0.1"),
        ),
    ],
)
def test_a_demo_measures_first_how_fast_rounds_can_be(work_s, speed, words, monkeypatch, capsys):
    monkeypatch.setattr(pace, "work_s", lambda raters, providers: work_s * raters * providers / 9)
    plan = demo._Plan("bad-mouthing", 120.0, 1.0, signed=True, seed=0)
    if speed is None:
        with refuses(ValueError, *words):
            demo._paced(plan)
        return
    assert demo._paced(plan).speed == speed
    printed = capsys.readouterr().out
    assert_names(printed, *words)
    assert printed.count("\n") == bool(words)


def test_work_is_measured_in_a_moment():
    assert 0 < pace.work_s(2, 3) < 60


def test_rounds_without_a_rater_or_without_an_end_are_counted(tmp_path):
    keeper = manager(tmp_path / "journal")
    for r in range(1, 50):
        for name in TEAM.raters[r % 5 == 0 :]:
            if r % 3:
                keeper.receive(
                    rating_message(name, r, dict.fromkeys(TEAM.providers, 1.0)),
                    PERIOD * r + 30_000_000,
                )
        keeper.tick(int(PERIOD * (r + 0.9)))
    entries, timeline = list(read_journal(tmp_path / "journal")), Timeline(PERIOD, PERIOD)
    assert pace.incomplete(entries, timeline, 22 * PERIOD) == 0
    lacking = {r for r in range(1, 50) if not r % 3 or not r % 5}
    for last in range(30, 50):  # round r of the manager is round r - 1 of the timeline
        assert pace.incomplete(entries, timeline, (last + 3) * PERIOD) == len(
            lacking & set(range(last - 20, last))
        )


def test_a_demo_stops_when_most_rounds_lack_a_rater(monkeypatch, tmp_path):
    class Nodes:
        """Processes of which none ever closes a round."""

        names = ("sp_0",)

        def __enter__(self):
            return self

        def __exit__(self, *failure):
            """Stop."""

        def __getattr__(self, name):
            return lambda *names, **arguments: True

    plan = demo._Plan("bad-mouthing", 120.0, 1.0, signed=True, seed=0)
    monkeypatch.setattr(demo, "NodeProcesses", Nodes)
    monkeypatch.setattr(pace, "work_s", lambda raters, providers: 0.7)
    moments = itertools.count(clock.now(), PERIOD)
    monkeypatch.setattr(clock, "now", lambda: next(moments))
    monkeypatch.setattr(demo.time, "sleep", lambda seconds: None)
    with refuses(ValueError, "20", "0.7", "0.5"):
        demo._run_team(plan, tmp_path, None, progress_bar())


@pytest.mark.parametrize(
    ("name", "code", "end", "words"),
    [
        ("sr_0", 0, 0, ("sr_0",)),
        ("sp_0", -9, 0, ("sp_0", "-9")),
        ("sp_0", 0, 2**62, ("sp_0",)),
        ("sp_0", 0, 0, None),
    ],
)
def test_a_node_that_ends_too_early_is_named(name, code, end, words):
    nodes = NodeProcesses()
    nodes._processes[name] = _Process(
        SimpleNamespace(exitcode=code), SimpleNamespace(poll=lambda: False)
    )
    with nullcontext() if words is None else refuses(ValueError, *words):
        nodes.check("sp_0", end=end)


@pytest.mark.parametrize(
    ("code", "words"),
    [(0, None), (-9, ("recorder", "-9")), (None, ("recorder",))],
)
def test_a_node_that_fails_at_the_end_is_named(code, words):
    with (
        nullcontext() if words is None else refuses(ValueError, *words),
        NodeProcesses() as nodes,
    ):
        node = Mock(exitcode=code)
        nodes._processes["recorder"] = _Process(node, Mock(poll=lambda: False))
    node.terminate.assert_called_once()
    node.kill.assert_called_once()


def record_ratings(folder, ratings, mask):
    """Write a recording of ratings (R, S, P), one message per rater and round."""
    with Recorder(folder) as recorder:
        for r in range(len(ratings)):
            for i, name in enumerate(TEAM.raters):
                row = {p: ratings[r, i, j] for j, p in enumerate(TEAM.providers) if mask[r, i, j]}
                raw = messages.encode(messages.ratings_message(name, PERIOD * (r + 1), row))
                recorder.write(
                    RecordedMessage(PERIOD * (r + 1) + i, f"/{name}/ratings", messages.RATINGS, raw)
                )


def test_a_replay_shows_its_progress(tmp_path, monkeypatch):
    monkeypatch.setattr(console, "_PERIOD", 0.0)
    record_ratings(tmp_path / "bag", *random_ratings(40))
    done = run("live", "manager", tmp_path / "journal", "--recording", tmp_path / "bag")
    stage = "Playing bag"
    shares = [
        line.removeprefix(stage).split()[0]
        for line in done.output.splitlines()
        if line.startswith(stage)
    ]
    assert len(shares) > 100, done.output
    assert shares[-1] == "100%"


def test_a_replay_writes_the_rounds_of_a_recording(tmp_path):
    notes, mask = random_ratings(10)
    record_ratings(tmp_path / "bag", notes, mask)
    printed(
        "live", "manager", tmp_path / "journal", "--recording", tmp_path / "bag", "--model", "mean"
    )
    direct = feed(manager(tmp_path / "direct", model="mean"), notes, mask)
    assert [entry.trust for entry in read_journal(tmp_path / "journal")] == [
        entry.trust for entry in direct
    ]
    assert (
        run("live", "manager", tmp_path / "journal", "--recording", tmp_path / "bag").exit_code == 2
    )


def test_the_curves_of_a_journal(tmp_path):
    keeper = manager(tmp_path / "journal")
    for r in (1, 2, 4):
        for name in TEAM.raters:
            keeper.receive(
                rating_message(name, r, dict.fromkeys(TEAM.providers, 1.0)), PERIOD * r + 30_000_000
            )
    entries = list(read_journal(tmp_path / "journal"))
    curves = curves_from_rounds([entry.published for entry in entries], PERIOD, PERIOD, 0.5)
    assert curves.time_s.tolist() == [0.5, 1.0, 2.0]
    assert curves.tor[:, 0, 0].tolist() == [entry.trust.tor[0] for entry in entries]
    assert _latencies_ms(entries) == [30.0] * 3
