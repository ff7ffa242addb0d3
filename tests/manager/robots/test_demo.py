"""The demo of the paper's robots, as far as it goes without processes of its own."""

import itertools

import pytest
from manager_cases import PERIOD, TEAM, manager, rating_message
from refusals import assert_names, refuses

from roletrust_manager.admission import clock
from roletrust_manager.dds.nodes.run_loop import Timeline
from roletrust_manager.journal.lines import read_journal
from roletrust_manager.robots import demo


@pytest.mark.parametrize(
    ("work_s", "speed", "words"),
    [
        (0.19, 1.0, ()),
        (0.32, 0.62, ("0.32", "0.81", "0.62")),
        (2.1, None, ("2.1", "2")),
    ],
)
def test_a_demo_measures_first_how_fast_rounds_can_be(work_s, speed, words, monkeypatch):
    monkeypatch.setattr(demo, "_work_s", lambda raters, providers: work_s * raters * providers / 9)
    lines = []
    if speed is None:
        with refuses(ValueError, *words):
            demo._possible_speed(1.0, lines.append)
        return
    assert demo._possible_speed(1.0, lines.append) == speed
    assert len(lines) == bool(words)
    assert_names("".join(lines), *words)


def test_work_is_measured_in_a_moment():
    assert 0 < demo._work_s(2, 3) < 60


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
    assert demo._incomplete(entries, timeline, 22 * PERIOD) == 0
    lacking = {r for r in range(1, 50) if not r % 3 or not r % 5}
    for last in range(30, 50):  # round r of the manager is round r - 1 of the timeline
        assert demo._incomplete(entries, timeline, (last + 3) * PERIOD) == len(
            lacking & set(range(last - 20, last))
        )


class Nodes:
    """Processes of which none ever closes a round."""

    names = ("manager", "sp_0")

    def __enter__(self):
        return self

    def __exit__(self, *failure):
        """Stop."""

    def __getattr__(self, name):
        return lambda *names, **arguments: None


def test_a_demo_stops_when_most_rounds_lack_a_rater(monkeypatch, tmp_path):
    monkeypatch.setattr(demo, "NodeProcesses", Nodes)
    monkeypatch.setattr(demo, "_work_s", lambda raters, providers: 0.1)
    moments = itertools.count(clock.now(), PERIOD)
    monkeypatch.setattr(clock, "now", lambda: next(moments))
    monkeypatch.setattr(demo.time, "sleep", lambda seconds: None)
    with refuses(ValueError, "20", "0.5"):
        demo.run_demo(tmp_path, {}, view=False)


def test_the_curves_and_delays_of_a_journal(tmp_path):
    keeper = manager(tmp_path / "journal")
    for r in (1, 2, 4):
        for name in TEAM.raters:
            keeper.receive(
                rating_message(name, r, dict.fromkeys(TEAM.providers, 1.0)), PERIOD * r + 30_000_000
            )
    entries = list(read_journal(tmp_path / "journal"))
    curves = demo._measured(entries, Timeline(PERIOD, PERIOD))
    assert curves.time_s.tolist() == [0.5, 1.0, 2.0]
    assert curves.tor[:, 0, 0].tolist() == [entry.trust.tor[0] for entry in entries]
    result = demo.DemoResult(1.0, entries, curves, curves)
    assert result.delays_ms == [30.0] * 3
    assert result.partial == 0
