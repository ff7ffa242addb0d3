"""What nodes make of messages that nobody should send: nothing. Without middleware."""

from collections import defaultdict

import cv2
import numpy as np
import pytest

from roletrust_env.live.nodes import watch
from roletrust_env.live.nodes.assess import _Eye, _pictures
from roletrust_env.live.nodes.running import Bulletin
from roletrust_env.live.nodes.topics import DIAGNOSTICS, TRUST
from roletrust_env.live.rounds import Patience, Rounds
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
    """Nodes and readers that hear what a test has put on a topic."""

    def __init__(self):
        self.waiting = defaultdict(list)

    def reader(self, topic, kind, **_):
        return type("Reader", (), {"take": lambda _: [self.waiting[topic].pop(0) for _ in self.waiting[topic][:]]})()

    def discover(self):
        return [Publication(CAMERA, messages.IMAGE)]

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
    bulletin = Bulletin(wire, 0.5)
    wire.waiting[TRUST] = [trust([0.25]), garbage]
    bulletin.hear()
    assert bulletin.tor("sr_0") == 0.25


@pytest.mark.parametrize("data", PICTURES, ids=["empty", "nonsense", "cut off", "a line"])
def test_what_is_no_picture_shows_nobody(data):
    assert _Eye(np.random.default_rng(0)).sees(bytes(data)) == 0.0


def test_a_rater_takes_pictures_of_now_only():
    late, soon = Patience(PERIOD).tolerance + 1, PERIOD
    raws = [b"", b"\0\1\0\0", *(image(NOW + off, jpeg(8, 8)) for off in (-late, 0, soon, late))]
    assert [stamp for stamp, _ in _pictures(raws, NOW, Patience(PERIOD).tolerance)] == [NOW, NOW + soon]


def test_a_camera_ahead_by_an_hour_ends_no_round_of_the_others():
    patience = Patience(PERIOD)
    rounds, whole, small = Rounds(patience), [], jpeg(8, 8)
    for r in range(20):
        now = NOW + r * PERIOD
        for camera in ("sp_0", "sp_1", "sp_2"):
            ahead = range(HOUR, HOUR + PERIOD, PERIOD // 30) if camera == "sp_2" else [0]
            sent = [image(now + some, small) for some in ahead]
            for stamp, picture in _pictures(sent, now, patience.tolerance):
                whole += rounds.add(camera, stamp, picture, now)
        for share in (0.3, 0.8):
            whole += rounds.due(now + int(share * PERIOD))
    assert [one.stamp for one in whole] == [NOW + r * PERIOD for r in range(20)]
    assert all(one.items.keys() == {"sp_0", "sp_1"} for one in whole[1:])  # the first to speak is alone


def test_a_watcher_goes_on_after_garbage(monkeypatch):
    wire = Wire()
    monkeypatch.setattr(watch, "Node", lambda *_, **__: wire)
    monkeypatch.setattr(watch.threading.Thread, "start", lambda _: None)
    watcher = watch.Watcher()
    monkeypatch.setattr(wire, "wait", lambda _: setattr(watcher, "_on", any(wire.waiting.values())))
    report = messages.encode(messages.diagnostics_message(NOW, watch.MANAGER, False, {"next round": "7"}))
    wire.waiting |= {
        TRUST: [b"", trust([0.5, 0.5]), trust([0.25])],
        DIAGNOSTICS: [b"", report, b"\0\1\0\0"],
        CAMERA: [image(NOW, jpeg(480, 640)), b""],
    }
    watcher._listen()
    assert [one.tor for one in watcher.heard] == [{"sr_0": 0.25}]
    assert watcher.reports == {"next round": "7"}
    for data in PICTURES:
        watcher._on, wire.waiting[CAMERA] = True, [image(NOW, data)]
        watcher._listen()


@pytest.mark.parametrize(("height", "width"), [(480, 640), (640, 480), (20_000, 1), (1, 20_000)])
def test_small_pictures_are_small_both_ways(height, width):
    small = cv2.imdecode(np.frombuffer(watch._small(jpeg(height, width)), np.uint8), cv2.IMREAD_COLOR)
    assert max(small.shape[:2]) == 320
