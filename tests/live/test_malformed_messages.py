"""Malformed messages, which nodes ignore. Without middleware."""

from collections import defaultdict

import cv2
import numpy as np
import pytest

from roletrust_env.live.nodes import team_listener
from roletrust_env.live.nodes.rater_node import _PersonDetector, _pictures
from roletrust_env.live.nodes.subscriptions import TrustSubscription
from roletrust_env.live.nodes.topics import DIAGNOSTICS, TRUST
from roletrust_env.live.rounds import RoundAssembler, RoundTiming
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Publication

PERIOD = 500_000_000
NOW = 1_000 * PERIOD
HOUR = 3_600_000_000_000
CAMERA = "/sp_0/image_raw/compressed"


def jpeg(height, width):
    return cv2.imencode(".jpg", np.full((height, width, 3), 90, np.uint8))[1]


PICTURES = [np.empty(0, np.uint8), np.frombuffer(b"nonsense", np.uint8), jpeg(64, 64)[:40], jpeg(20_000, 1)]


class Wire:
    """A node whose readers get the messages that a test puts on a topic."""

    def __init__(self):
        self.waiting = defaultdict(list)
        self.publications = [Publication(CAMERA, messages.IMAGE)]

    def reader(self, topic, kind, **_):
        return type("Reader", (), {"take": lambda _: [self.waiting[topic].pop(0) for _ in self.waiting[topic][:]]})()

    def discover(self):
        return self.publications

    def wait(self, seconds):
        pass


def trust(tor, raters=("sr_0",)):
    numbers = {"tor": np.array(tor, float), "top": np.empty(0), "toa": np.empty(0)}
    names = {"raters": list(raters), "providers": [], "both": [], "missing": []}
    return messages.encode(messages.make(messages.TRUST, header=messages.header(NOW), round=0, **names, **numbers))


def image(stamp, data):
    return messages.encode(messages.image_message(stamp, "sp_0", data))


@pytest.mark.parametrize("garbage", [b"", b"\0\1\0\0", trust([0.9, 0.9]), trust([], ["sr_0", "sr_1"])])
def test_trust_that_cannot_be_read_changes_nothing(garbage):
    wire = Wire()
    subscription = TrustSubscription(wire, 0.5)
    wire.waiting[TRUST] = [trust([0.25]), garbage]
    subscription.update()
    assert subscription.tor("sr_0") == 0.25


@pytest.mark.parametrize("data", PICTURES, ids=["empty", "nonsense", "cut off", "a line"])
def test_an_invalid_picture_shows_no_person(data):
    assert _PersonDetector(np.random.default_rng(0)).probability(bytes(data)) == 0.0


def test_a_rater_ignores_pictures_with_stamps_far_from_now():
    limit = RoundTiming(PERIOD).tolerance
    raws = [b"", b"\0\1\0\0", *(image(NOW + off, jpeg(8, 8)) for off in (-limit - 1, -limit, 0, limit, limit + 1))]
    assert [stamp for stamp, _ in _pictures(raws, NOW, limit)] == [NOW - limit, NOW, NOW + limit]


def test_a_camera_ahead_by_an_hour_closes_no_round_of_the_others():
    timing = RoundTiming(PERIOD)
    rounds, whole, small = RoundAssembler(timing), [], jpeg(8, 8)
    for r in range(20):
        now = NOW + r * PERIOD
        for camera in ("sp_0", "sp_1", "sp_2"):
            ahead = range(HOUR, HOUR + PERIOD, PERIOD // 30) if camera == "sp_2" else [0]
            sent = [image(now + some, small) for some in ahead]
            for stamp, picture in _pictures(sent, now, timing.tolerance):
                whole += rounds.add(camera, stamp, picture, now)
        for share in (0.3, 0.8):
            whole += rounds.close_due(now + int(share * PERIOD))
    assert [one.stamp for one in whole] == [NOW + r * PERIOD for r in range(20)]
    assert all(
        one.items.keys() == {"sp_0", "sp_1"} for one in whole[1:]
    )  # the first camera is alone in the first round


def test_a_listener_continues_after_malformed_messages(monkeypatch):
    wire = Wire()
    monkeypatch.setattr(team_listener, "Node", lambda *_, **__: wire)
    monkeypatch.setattr(team_listener.threading.Thread, "start", lambda _: None)
    listener = team_listener.TeamListener()
    monkeypatch.setattr(wire, "wait", lambda _: setattr(listener, "_active", any(wire.waiting.values())))
    report = messages.encode(messages.diagnostics_message(NOW, team_listener.MANAGER, False, {"next round": "7"}))
    wire.waiting |= {
        TRUST: [b"", trust([0.5, 0.5]), trust([0.25])],
        DIAGNOSTICS: [b"", report, b"\0\1\0\0"],
        CAMERA: [image(NOW, jpeg(480, 640)), b""],
    }
    listener._listen()
    assert [one.tor for one in listener.rounds] == [{"sr_0": 0.25}]
    assert listener.diagnostics == {"next round": "7"}
    for data in PICTURES:
        listener._active, wire.waiting[CAMERA] = True, [image(NOW, data)]
        listener._listen()


def test_a_listener_ignores_other_nodes_and_other_types(monkeypatch):
    wire = Wire()
    wire.publications = [Publication(CAMERA, messages.NUMBER), Publication("/sr_0/ratings", messages.RATINGS)]
    monkeypatch.setattr(team_listener, "Node", lambda *_, **__: wire)
    monkeypatch.setattr(team_listener.threading.Thread, "start", lambda _: None)
    listener = team_listener.TeamListener()
    monkeypatch.setattr(wire, "wait", lambda _: setattr(listener, "_active", False))
    report = messages.diagnostics_message(NOW, "another node", False, {"next round": "7"})
    rating = messages.ratings_message("sr_0", NOW, {"sp_0": 0.5})
    wire.waiting |= {DIAGNOSTICS: [messages.encode(report)], "/sr_0/ratings": [messages.encode(rating)]}
    wire.waiting[CAMERA] = [image(NOW, jpeg(8, 8))]
    listener._listen()
    assert listener.diagnostics == listener.pictures == {}
    assert list(listener.last_heard) == ["sr_0"]


@pytest.mark.parametrize(("height", "width"), [(480, 640), (640, 480), (20_000, 1), (1, 20_000)])
def test_pictures_are_scaled_by_their_longer_side(height, width):
    small = cv2.imdecode(np.frombuffer(team_listener._scaled_down(jpeg(height, width)), np.uint8), cv2.IMREAD_COLOR)
    assert max(small.shape[:2]) == 320
