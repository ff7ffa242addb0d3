"""Signed pictures, trust and diagnostics: forged, altered and replayed ones are refused with their
reason."""

import cv2
import numpy as np
import pytest
from fake_wire import FakeWire
from manager_cases import TEAM

from roletrust_manager.admission import clock
from roletrust_manager.admission.keys import PublicKeys, Signer, make_keys
from roletrust_manager.admission.validation import MANAGER, RefusalReason
from roletrust_manager.dds.nodes import team_listener
from roletrust_manager.dds.nodes.inboxes import LIMITS
from roletrust_manager.dds.rounds import RoundTiming
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.topics import DIAGNOSTICS, IMAGES, TRUST
from roletrust_manager.journal.lines import JournalEntry
from roletrust_manager.team import Trust

PERIOD = 500_000_000
NOW = 1_000 * PERIOD
CAMERA = f"/sp_0{IMAGES}"
JPEG = cv2.imencode(".jpg", np.full((48, 64, 3), 90, np.uint8))[1].tobytes()


@pytest.fixture
def keys(tmp_path):
    make_keys(tmp_path, [MANAGER, *TEAM.raters, *TEAM.providers])
    return tmp_path


@pytest.fixture
def page(keys, monkeypatch):
    """Return a listener with keys whose loop turns once at each call, while its clock stands
    still."""
    wire = FakeWire()
    monkeypatch.setattr(clock, "now", lambda: NOW)
    monkeypatch.setattr(team_listener, "Node", lambda *_, **__: wire)
    monkeypatch.setattr(team_listener.threading.Thread, "start", lambda _: None)
    listener = team_listener.TeamListener(TEAM, RoundTiming(PERIOD), keyring=PublicKeys(keys))
    wire.announce(IMAGES, messages.IMAGE, "sp_0", "z0")
    monkeypatch.setattr(wire, "wait", lambda _: setattr(listener, "_active", False))

    def turn(topic, *sent):
        wire.waiting[topic] += [messages.encode(one) for one in sent]
        listener._active = True
        listener._listen()
        return listener

    return turn


def trust(signer, stamp, value=0.5, round=3):
    trusted = Trust((value,) * 3, (value,) * 3, ())
    return messages.trust_message(JournalEntry(round, stamp, stamp, TEAM, {}, (), trusted), signer)


def picture(signer, stamp, camera="sp_0", jpeg=JPEG):
    return messages.picture_message(stamp, camera, jpeg, signer)


def report(signer, stamp, value="7"):
    return messages.diagnostics_message(stamp, MANAGER, False, {"next round": value}, signer)


def altered(message, **changes):
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def test_what_is_signed_is_shown(page, keys):
    assert page(TRUST, trust(Signer(keys, MANAGER), NOW)).rounds[0].tor == dict.fromkeys(
        TEAM.raters, 0.5
    )
    assert list(page(CAMERA, picture(Signer(keys, "sp_0"), NOW)).pictures) == ["sp_0"]
    listener = page(DIAGNOSTICS, report(Signer(keys, MANAGER), NOW))
    assert listener.reports == {MANAGER: {"next round": "7"}}
    assert not listener.refusals


@pytest.mark.parametrize(
    ("forge", "reason"),
    [
        (lambda keys: trust(None, NOW, 0.01, 10039), RefusalReason.UNSIGNED),
        (lambda keys: trust(Signer(keys, "sr_0"), NOW, 0.01), RefusalReason.MIS_SIGNED),
        (
            lambda keys: altered(trust(Signer(keys, MANAGER), NOW), round=10039),
            RefusalReason.MIS_SIGNED,
        ),
        (
            lambda keys: trust(Signer(keys, MANAGER), NOW - LIMITS.tolerance - PERIOD),
            RefusalReason.PAST,
        ),
        (
            lambda keys: trust(Signer(keys, MANAGER), NOW + LIMITS.tolerance + PERIOD),
            RefusalReason.FUTURE,
        ),
        (lambda keys: trust(Signer(keys, MANAGER), NOW - PERIOD), RefusalReason.REPLAYED),
    ],
)
def test_forged_trust_is_counted_and_not_displayed(forge, reason, page, keys):
    page(TRUST, trust(Signer(keys, MANAGER), NOW - PERIOD))
    listener = page(TRUST, forge(keys))
    assert len(listener.rounds) == 1
    assert listener.refusals == {(MANAGER, reason): 1}
    assert len(page(TRUST, trust(Signer(keys, MANAGER), NOW, 0.75)).rounds) == 2


@pytest.mark.parametrize(
    ("forge", "reason"),
    [
        (lambda keys: picture(None, NOW), RefusalReason.UNSIGNED),
        (lambda keys: picture(Signer(keys, "sp_1"), NOW), RefusalReason.MIS_SIGNED),
        (lambda keys: picture(Signer(keys, "sp_0"), NOW, camera="sp_1"), RefusalReason.MIS_SIGNED),
        (
            lambda keys: altered(
                picture(Signer(keys, "sp_0"), NOW), header=messages.header(NOW + 1)
            ),
            RefusalReason.MIS_SIGNED,
        ),
        (lambda keys: picture(Signer(keys, "sp_0"), NOW - 10 * PERIOD), RefusalReason.PAST),
        (lambda keys: picture(Signer(keys, "sp_0"), NOW - PERIOD), RefusalReason.REPLAYED),
        (lambda keys: picture(Signer(keys, "sp_0"), NOW - PERIOD + 1), RefusalReason.TOO_SOON),
    ],
)
def test_forged_pictures_are_counted_and_not_displayed(forge, reason, page, keys):
    page(CAMERA, picture(Signer(keys, "sp_0"), NOW - PERIOD))
    listener = page(CAMERA)
    listener.pictures.clear()
    page(CAMERA, forge(keys))
    assert not listener.pictures
    assert listener.refusals == {("sp_0", reason): 1}
    assert list(page(CAMERA, picture(Signer(keys, "sp_0"), NOW)).pictures) == ["sp_0"]


def test_a_camera_without_a_key_is_not_even_received(page, keys):
    assert not page(f"/z0{IMAGES}", picture(None, NOW, "z0")).pictures
    assert not page(f"/z0{IMAGES}").refusals


@pytest.mark.parametrize(
    ("forge", "reason"),
    [
        (lambda keys: report(None, NOW), RefusalReason.UNSIGNED),
        (lambda keys: report(Signer(keys, "sr_1"), NOW), RefusalReason.MIS_SIGNED),
        (
            lambda keys: altered(
                report(Signer(keys, MANAGER), NOW), header=messages.header(NOW + 1)
            ),
            "mis-signed",
        ),
    ],
)
def test_forged_diagnostics_are_counted_and_not_displayed(forge, reason, page, keys):
    listener = page(DIAGNOSTICS, forge(keys))
    assert not listener.reports
    assert listener.refusals == {(MANAGER, reason): 1}


def test_a_signed_picture_is_the_jpeg_for_every_decoder(keys):
    message = picture(Signer(keys, "sp_0"), 5)
    shown = cv2.imdecode(message.data, cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(
        shown, cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_COLOR)
    )
    assert messages.read_picture_message("sp_0", messages.encode(message)).jpeg == JPEG
