"""The page of `roletrust robots view`, without a team and without a browser."""

import urllib.request
import webbrowser
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest
from bokeh.client import pull_session
from bokeh.document import Document
from bokeh.models.widgets.markups import Div
from refusals import refuses
from tornado.ioloop import IOLoop

from roletrust_experiments.plots.style import ATTACKER, HONEST
from roletrust_manager.admission.validation import MANAGER, RefusalReason
from roletrust_manager.page import dashboard as dashboards
from roletrust_manager.page.browser import open_page
from roletrust_manager.page.dashboard import Dashboard
from roletrust_manager.page.page import Page, make_page, serve
from roletrust_manager.team import PublishedTrust

PERIOD_S = 0.5
NOW_S = 1_000_000.0


class Team:
    """A listener that receives what a test publishes."""

    def __init__(self):
        self.rounds, self.pictures, self.last_heard, self.reports, self.refusals = (
            [],
            {},
            {},
            {},
            {},
        )

    def say(self, round, tor, missing=()):
        self.rounds.append(
            PublishedTrust(round, 10**18 + round * 500_000_000, tor, {"sp_0": 0.75}, missing)
        )
        self.last_heard |= dict.fromkeys([MANAGER, *set(tor) - set(missing)], NOW_S)


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    """A clock that stands still, so that nobody falls silent on a slow machine."""
    monkeypatch.setattr(dashboards, "time", SimpleNamespace(monotonic=lambda: NOW_S))


@pytest.fixture
def team():
    return Team()


@pytest.fixture
def dashboard(team):
    return Dashboard(team, PERIOD_S, speed=2.0, attackers=("sr_1",))


def parts(dashboard):
    """Return the current parts, not those of a moment ago."""
    dashboard._parts_at = 0.0
    return dashboard.parts()


def test_curves_follow_what_is_heard(team, dashboard):
    page = Page(dashboard)
    assert page._tor.source.data == {"time_s": []}
    team.say(0, {"sr_0": 0.5, "sr_1": 0.9})
    team.say(1, {"sr_0": 0.25, "sr_1": 0.9}, missing=("sr_1",))
    page.refresh()
    assert dict(page._tor.source.data) == {"time_s": [0.0, 1.0], "0": [0.5, 0.25], "1": [0.9, 0.9]}
    assert page._top.source.data["0"] == [0.75, 0.75]
    assert page._arrivals.source.data["rater"] == ["sr_0", "sr_1"] * 2
    assert page._arrivals.source.data["colour"] == [HONEST[1]] * 3 + [ATTACKER]
    assert [line.glyph.line_color for line in page._tor.figure.renderers] == [HONEST[0], ATTACKER]
    page.refresh()
    assert len(page._tor.source.data["time_s"]) == 2


def test_a_newcomer_has_no_trust_before(team, dashboard):
    page = Page(dashboard)
    team.say(0, {"sr_0": 0.5})
    page.refresh()
    team.say(1, {"sr_0": 0.5, "sr_2": 0.6})
    page.refresh()
    before, after = page._tor.source.data["1"]
    assert before != before
    assert after == 0.6
    assert page._arrivals._raters.factors == ["sr_2", "sr_0"]


def test_the_state_of_the_round(team, dashboard):
    assert "No round yet" in parts(dashboard).state
    team.say(0, {"sr_0": 0.5})
    assert "nobody is missing" in parts(dashboard).state
    team.say(1, {"sr_0": 0.5}, missing=("sr_0",))
    assert "missing: sr_0" in parts(dashboard).state
    team.last_heard[MANAGER] -= 1
    assert "The manager has been silent" in parts(dashboard).state


def test_a_silent_agent_is_gone_before_two_periods_are_over(team, dashboard):
    team.say(0, {"sr_0": 0.5, "sr_1": 0.5})
    team.pictures = {"sp_0": b"jpeg", "sp_1": b"jpeg"}
    team.last_heard |= {
        "sp_0": NOW_S,
        "sp_1": NOW_S - 1.7 * PERIOD_S,
        "sr_1": NOW_S - 1.7 * PERIOD_S,
    }
    shown = parts(dashboard)
    assert [name in shown.cameras for name in ("sp_0: gone", "sp_1: gone")] == [False, True]
    assert [name in shown.raters for name in ("sr_0: gone", "sr_1: gone")] == [False, True]
    assert 1.7 * PERIOD_S + dashboard.refresh_s <= 2 * PERIOD_S + 0.1


def test_refusals_are_shown_with_their_reason(team, dashboard):
    assert "Nothing was refused" in parts(dashboard).refused
    team.reports = {
        "sr_0": {"sp_0: unsigned": "2"},
        MANAGER: {"sr_1: out of range": "7", "waited for": "sr_0 sr_1"},
    }
    team.refusals = {(MANAGER, RefusalReason.MIS_SIGNED): 3}
    rows = [
        '<th scope="row">sr_1</th><td>out of range</td><td>7</td><td>manager</td>',
        '<th scope="row">sp_0</th><td>unsigned</td><td>2</td><td>sr_0</td>',
        '<th scope="row">manager</th><td>mis-signed</td><td>3</td><td>this page</td>',
    ]
    places = [parts(dashboard).refused.index(row) for row in rows]
    assert places == sorted(places)
    assert "waited" not in parts(dashboard).refused


def test_names_from_the_network_are_escaped(team, dashboard):
    bad = "<script>"
    team.say(0, {bad: 0.5}, missing=(bad,))
    team.pictures, team.reports = {bad: b"jpeg"}, {bad: {f"{bad}: {bad}": bad}}
    team.refusals = {(bad, RefusalReason.GARBAGE): 1}
    assert bad not in "".join(parts(dashboard))
    assert all(text.disable_math for text in Page(dashboard)._parts.values())  # nor is `$$` TeX


def test_all_viewers_share_the_same_parts(team, dashboard):
    team.say(0, {"sr_0": 0.5})
    shared = dashboard.parts()
    assert dashboard.parts() is shared
    documents = [Document() for _ in range(3)]
    for document in documents:
        make_page(dashboard, document)
    texts = [
        [root.text for root in document.roots if isinstance(root, Div)] for document in documents
    ]
    assert texts[0] == texts[1] == texts[2] == list(shared)


def test_a_page_answers_requests_from_before_its_server(team, dashboard, caplog, monkeypatch):
    opened, lines, loop = [], [], IOLoop.current()
    monkeypatch.setattr(webbrowser, "open", opened.append)
    with (
        open_page(0, lines.append) as taken,
        open_page(taken.getsockname()[1], lines.append) as listening,
        ThreadPoolExecutor(1) as aside,
    ):
        assert listening.getsockname()[0] == "127.0.0.1"
        assert len(set(opened)) == 2
        assert all(url in line for url, line in zip(opened, lines, strict=True))
        early = aside.submit(fetch, opened[1])  # it waits for the server
        server = serve(dashboard, listening)
        try:
            body = loop.run_sync(lambda: loop.run_in_executor(None, early.result))
            assert "RoleTrust, live" in body
            assert "cdn." not in body  # the browser needs no other server
            session = loop.run_sync(
                lambda: loop.run_in_executor(None, lambda: pull_session(url=opened[1]))
            )
            assert session.document.title == "RoleTrust, live"
        finally:
            server.stop()
    assert caplog.records == []  # the figures are empty, of which Bokeh warns


@pytest.mark.parametrize("port", [-1, 65536, 1.5, "http"])
def test_a_port_that_does_not_exist_is_refused(port):
    with refuses(ValueError, "port", port):
        open_page(port, print)


def fetch(url):
    with urllib.request.urlopen(url) as answer:
        return answer.read().decode()
