"""The page of `roletrust live view`, as a browser gets it."""

import time
import urllib.request

import cv2
import numpy as np
import pytest
from bokeh.client import pull_session
from tornado.ioloop import IOLoop

from experiments.plots import live_page
from roletrust_env.live.nodes.watch import Heard, Picture


class Team:
    """What a watcher would have heard."""

    def __init__(self):
        self.heard, self.pictures, self.reports = [], {}, {}

    def say(self, round, tor, missing=(), time_s=None):
        top = {"sp_0": 0.75}
        self.heard.append(Heard(round, time.time() if time_s is None else time_s, tor, top, missing))


@pytest.fixture
def jpeg():
    return cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes()


def lines(page):
    return {source.name: list(source.data["trust"]) for source in page.select({"name": "sr_0"})}


def test_the_page_follows_what_is_heard(jpeg):
    team = Team()
    page = live_page._Page(team, 0.5)
    assert "No round yet" in page._state.text
    team.say(0, {"sr_0": 0.5, "sr_1": 0.9})
    team.say(1, {"sr_0": 0.25, "sr_1": 0.9}, missing=("sr_1",))
    team.pictures = {"sp_0": Picture(jpeg, time.time()), "sp_1": Picture(jpeg, time.time() - 1.5)}
    team.reports = {"sr_1: out of range": "7", "waited for": "sr_0 sr_1"}
    page.refresh()
    assert page._tor._sources["sr_0"].data == {"round": [0, 1], "trust": [0.5, 0.25]}
    assert page._top._sources["sp_0"].data["trust"] == [0.75, 0.75]
    assert "Round 1</b>, missing: sr_1" in page._state.text
    assert page._matches.data["rater"] == ["sr_0", "sr_1"] * 2
    assert [colour == live_page.ATTACKER for colour in page._matches.data["colour"]] == [False, False, False, True]
    assert "<td>sr_1: out of range</td><td>7</td>" in page._refused.text
    assert "sp_1: gone" in page._pictures.text
    assert "sp_0: gone" not in page._pictures.text


def test_newcomers_and_a_silent_manager():
    team = Team()
    team.say(0, {"sr_0": 0.5})
    page = live_page._Page(team, 0.5)
    team.say(1, {"sr_0": 0.5, "sr_1": 0.6}, time_s=time.time() - 10)
    page.refresh()
    assert page._tor._sources["sr_1"].data["trust"] == [None, 0.6]
    assert "the manager is silent" in page._state.text


def test_names_from_the_network_are_no_html():
    team = Team()
    team.say(0, {"sr_0": 0.5}, missing=("<script>",))
    team.reports = {"<b>x</b>: unsigned": "<i>"}
    page = live_page._Page(team, 0.5)
    assert "<script>" not in page._state.text
    assert "<b>x" not in page._refused.text


def test_the_page_is_served_to_this_machine_only():
    team = Team()
    team.say(0, {"sr_0": 0.5})
    server = live_page.serve(team, 0.5, port := 5997)
    try:
        (socket,) = server._http._sockets.values()
        assert socket.getsockname()[0] == "127.0.0.1"
        loop = IOLoop.current()
        body = loop.run_sync(lambda: loop.run_in_executor(None, fetch, f"http://127.0.0.1:{port}/"))
        assert "RoleTrust, live" in body
        assert "cdn." not in body  # all that a browser needs comes from here
        session = loop.run_sync(
            lambda: loop.run_in_executor(None, lambda: pull_session(url=f"http://localhost:{port}/"))
        )
        assert session.document.title == "RoleTrust, live"
        with pytest.raises(ValueError, match="port 5997 cannot be had"):
            live_page.serve(team, 0.5, port)
    finally:
        server.stop()


def fetch(url):
    with urllib.request.urlopen(url) as answer:
        return answer.read().decode()
