"""Malformed messages, which nodes ignore. Without middleware."""

import cv2
import numpy as np
import pytest
from fake_wire import FakeWire
from manager_cases import TEAM

from roletrust_manager.admission import clock
from roletrust_manager.admission.validation import MANAGER, RefusalReason
from roletrust_manager.dds.nodes import team_listener
from roletrust_manager.dds.nodes.inboxes import TrustSubscription, camera_inbox
from roletrust_manager.dds.nodes.person_detector import PersonDetector
from roletrust_manager.dds.rounds import RoundAssembler, RoundTiming
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.topics import DIAGNOSTICS, IMAGES, TRUST
from roletrust_manager.team import Team

PERIOD = 500_000_000
NOW = 1_000 * PERIOD
HOUR = 3_600_000_000_000
CAMERA = "/sp_0/image_raw/compressed"


@pytest.fixture(autouse=True)
def _clock(monkeypatch):
    """A clock that stands still, so that nothing is too old on a busy machine."""
    monkeypatch.setattr(clock, "now", lambda: NOW)


def jpeg(height, width):
    return cv2.imencode(".jpg", np.full((height, width, 3), 90, np.uint8))[1]


PICTURES = [
    np.empty(0, np.uint8),
    np.frombuffer(b"nonsense", np.uint8),
    jpeg(64, 64)[:40],
    jpeg(20_000, 1),
]


def trust(tor, raters=("sr_0",)):
    numbers = {"tor": np.array(tor, float), "top": np.empty(0), "toa": np.empty(0)}
    names = {"raters": list(raters), "providers": [], "both": [], "missing": []}
    header = messages.header(NOW)
    message = messages.make(
        messages.TRUST, header=header, round=0, signature=np.empty(0, np.uint8), **names, **numbers
    )
    return messages.encode(message)


def image(stamp, data):
    return messages.encode(messages.picture_message(stamp, "sp_0", bytes(data)))


@pytest.mark.parametrize(
    "garbage",
    [b"", b"\0\1\0\0", trust([0.9, 0.9]), trust([], ["sr_0", "sr_1"])],
    ids=["empty", "header", "too many", "too few"],
)
def test_trust_that_cannot_be_read_changes_nothing(garbage):
    wire = FakeWire()
    subscription = TrustSubscription(wire, 0.5)
    wire.waiting[TRUST] += [trust([0.25]), garbage]
    subscription.update()
    assert subscription.tor("sr_0") == 0.25
    assert subscription.inbox.admission.refusals == {(MANAGER, RefusalReason.GARBAGE): 1}


@pytest.mark.parametrize("data", PICTURES, ids=["empty", "nonsense", "cut off", "a line"])
def test_an_invalid_picture_shows_no_person(data):
    assert PersonDetector(np.random.default_rng(0)).probability(bytes(data)) == 0.0


def inbox(wire, *cameras):
    """Return an inbox that has subscribed to some cameras of a scenario, without keys."""
    made = camera_inbox(wire, RoundTiming(PERIOD), None, Team((), cameras))
    made.update(wire.announce(IMAGES, messages.IMAGE, *cameras))
    return made


def test_a_rater_ignores_pictures_with_stamps_far_from_now():
    wire, limit = FakeWire(), RoundTiming(PERIOD).tolerance
    pictures = inbox(wire, "sp_0")
    wire.waiting[CAMERA] += [b"", b"\0\1\0\0"]
    wire.waiting[CAMERA] += [
        image(NOW + off, jpeg(8, 8)) for off in (-limit - 1, -limit, 0, limit, limit + 1)
    ]
    assert [one.envelope.stamp for one in pictures.take(NOW)] == [NOW - limit, NOW, NOW + limit]
    assert pictures.admission.refusals[("sp_0", RefusalReason.FUTURE)] == 1


def test_a_camera_that_sends_too_often_is_cut_off_from_the_first_period_on():
    wire = FakeWire()
    pictures = inbox(wire, "sp_0")
    wire.waiting[CAMERA] += [image(NOW + k, jpeg(8, 8)) for k in range(100)]
    assert len(list(pictures.take(NOW))) == 1
    assert pictures.admission.refusals == {("sp_0", RefusalReason.TOO_SOON): 99}


def test_a_camera_ahead_by_an_hour_closes_no_round_of_the_others():
    wire, timing, small = FakeWire(), RoundTiming(PERIOD), jpeg(8, 8)
    cameras = ("sp_0", "sp_1", "sp_2")
    rounds, whole, pictures = RoundAssembler(timing), [], inbox(wire, *cameras)
    for r in range(20):
        now = NOW + r * PERIOD
        for camera in cameras:
            ahead = range(HOUR, HOUR + PERIOD, PERIOD // 30) if camera == "sp_2" else [0]
            wire.waiting[f"/{camera}{IMAGES}"] += [image(now + offset, small) for offset in ahead]
        for picture, envelope in pictures.take(now):
            whole += rounds.add(envelope.sender, envelope.stamp, picture, now)
        for share in (0.3, 0.8):
            whole += rounds.close_due(now + int(share * PERIOD))
    assert [one.stamp for one in whole] == [NOW + r * PERIOD for r in range(20)]
    assert all(
        one.items.keys() == {"sp_0", "sp_1"} for one in whole[1:]
    )  # the first camera is alone in the first round


@pytest.fixture
def listening(monkeypatch):
    """Return a node and a function that returns a listener after one turn of its loop."""
    wire = FakeWire()
    monkeypatch.setattr(team_listener, "Node", lambda *_, **__: wire)
    monkeypatch.setattr(team_listener.threading.Thread, "start", lambda _: None)

    def listen(listener=None, **options):
        listener = listener or team_listener.TeamListener(TEAM, RoundTiming(PERIOD), **options)
        monkeypatch.setattr(wire, "wait", lambda _: setattr(listener, "_active", False))
        listener._active = True
        listener._listen()
        return listener

    return wire, listen


def report(name, values, stamp=None):
    return messages.encode(messages.diagnostics_message(stamp or NOW, name, False, values, None))


def test_a_listener_continues_after_malformed_messages(listening):
    wire, listen = listening
    wire.announce(IMAGES, messages.IMAGE, "sp_0")
    wire.waiting[TRUST] += [b"", trust([0.5, 0.5]), trust([0.25])]
    wire.waiting[DIAGNOSTICS] += [b"", report(MANAGER, {"next round": "7"}), b"\0\1\0\0"]
    wire.waiting[CAMERA] += [image(NOW, jpeg(480, 640)), b""]
    listener = listen()
    assert [one.tor for one in listener.rounds] == [{"sr_0": 0.25}]
    assert listener.reports == {MANAGER: {"next round": "7"}}
    assert listener.refusals == {("", RefusalReason.GARBAGE): 4, ("sp_0", RefusalReason.GARBAGE): 1}
    for k, data in enumerate(PICTURES, 1):
        wire.waiting[CAMERA] += [image(NOW + k * PERIOD // 2, data)]
        listen(listener)


def test_a_listener_ignores_other_nodes_and_other_types(listening):
    wire, listen = listening
    wire.announce(IMAGES, messages.NUMBER, "sp_0")
    wire.announce("/ratings", messages.RATINGS, "sr_0")
    wire.waiting[DIAGNOSTICS] += [report("another node", {"next round": "7"})]
    wire.waiting["/sr_0/ratings"] += [
        messages.encode(messages.ratings_message("sr_0", NOW, {"sp_0": 0.5}))
    ]
    wire.waiting[CAMERA] += [image(NOW, jpeg(8, 8))]
    listener = listen()
    assert listener.reports == listener.pictures == {}
    assert list(listener.last_heard) == ["sr_0"]


@pytest.mark.parametrize(("height", "width"), [(480, 640), (640, 480), (20_000, 1), (1, 20_000)])
def test_pictures_are_scaled_by_their_longer_side(height, width):
    small = cv2.imdecode(
        np.frombuffer(team_listener._scaled_down(jpeg(height, width)), np.uint8), cv2.IMREAD_COLOR
    )
    assert max(small.shape[:2]) == 320
