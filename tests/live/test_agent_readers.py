"""Readers of agents that come and go."""

import pytest
from fake_wire import FakeWire

from roletrust_env.live.nodes import inboxes
from roletrust_env.live.nodes.inboxes import AgentInbox
from roletrust_env.live.rounds import RoundTiming
from roletrust_env.live.validation import MAX_STRANGERS, MessageValidator, StampLimits
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.topics import IMAGES

STRANGERS = [f"z{k}" for k in range(200)]


class Clock:
    """A clock that a test moves."""

    now = 0.0

    def monotonic(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr(inboxes, "time", made)
    return made


def readers(wire, strangers=True):
    validator, timing = MessageValidator(StampLimits(10**9, 1)), RoundTiming(500_000_000)
    known = "sp_0", "sp_1"
    return AgentInbox(
        wire, IMAGES, messages.IMAGE, messages.read_picture, validator, known, strangers=strangers, timing=timing
    )


def names(inbox):
    return [name for name, _ in inbox.readers()]


def test_known_agents_come_first_and_strangers_are_limited(clock):
    wire = FakeWire()
    made = readers(wire)
    made.update(wire.announce(IMAGES, messages.IMAGE, *STRANGERS, participant="mean"))
    made.update(wire.announce(IMAGES, messages.IMAGE, "sp_1", "sp_0"))
    assert names(made)[:2] == ["sp_1", "sp_0"]
    assert names(made)[2:] == STRANGERS[:MAX_STRANGERS]
    assert made.turned_away == {"mean": 200 - MAX_STRANGERS}


def test_strangers_are_not_read_at_all_if_there_are_keys(clock):
    wire = FakeWire()
    made = readers(wire, strangers=False)
    made.update(wire.announce(IMAGES, messages.IMAGE, "z0", "sp_0"))
    made.update(wire.announce(IMAGES, messages.NUMBER, "sp_1"))
    assert names(made) == ["sp_0"]
    assert list(wire.readers) == [f"/sp_0{IMAGES}"]


def test_a_topic_whose_writers_have_gone_is_dropped_and_read_again_when_they_return(clock):
    wire = FakeWire()
    made = readers(wire)
    made.update(wire.announce(IMAGES, messages.IMAGE, "sp_0", "sp_1"))
    wire.announced.clear()
    wire.readers[f"/sp_0{IMAGES}"].writers = 0
    for clock.now in (2.0, 4.0, 5.5, 7.5):
        made.update([])
        assert names(made) == (["sp_0", "sp_1"] if clock.now < 5 else ["sp_1"])
    assert wire.dropped == [f"/sp_0{IMAGES}"]
    made.update(wire.announce(IMAGES, messages.IMAGE, "sp_0"))
    assert names(made) == ["sp_1", "sp_0"]


def test_a_writer_that_connects_late_is_read(clock):
    """Another middleware may take more than five seconds to connect on a busy machine; it is announced all the time."""
    wire = FakeWire()
    made = readers(wire)
    made.update(wire.announce(IMAGES, messages.IMAGE, "sp_0"))
    wire.readers[f"/sp_0{IMAGES}"].writers = 0
    for clock.now in (2.0, 8.0):
        made.update([])
    assert wire.dropped == [f"/sp_0{IMAGES}"]
    assert names(made) == ["sp_0"]


def test_a_stranger_that_leaves_has_its_place_taken_by_another(clock):
    wire = FakeWire()
    made = readers(wire)
    made.update(wire.announce(IMAGES, messages.IMAGE, *STRANGERS[:MAX_STRANGERS]))
    wire.announced.clear()
    made.update(wire.announce(IMAGES, messages.IMAGE, "late"))
    wire.readers[f"/z0{IMAGES}"].writers = 0
    for clock.now in (2.0, 8.0):
        made.update([])
    assert "z0" not in names(made)
    assert "late" in names(made)


def test_many_participants_take_no_memory(clock):
    wire = FakeWire()
    made = readers(wire)
    for k, name in enumerate(STRANGERS):
        made.update(wire.announce(IMAGES, messages.IMAGE, name, participant=f"participant {k}"))
    assert len(made.turned_away) <= 21
    assert made.turned_away.total() == 200 - MAX_STRANGERS
