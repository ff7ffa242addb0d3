"""Incoming messages: agents that come and go, subscriptions, times of rounds, and signals. Without
middleware."""

import signal
import time

import numpy as np
import pytest
from fake_wire import FakeWire
from manager_cases import TEAM, manager

from roletrust_manager.admission.validation import (
    MAX_STRANGERS,
    Admission,
    RefusalReason,
    StampLimits,
)
from roletrust_manager.dds.nodes import inboxes, run_loop
from roletrust_manager.dds.nodes.inboxes import (
    AgentInbox,
    RatingSubscription,
    TrustSubscription,
    rating_inbox,
    trust_limits,
)
from roletrust_manager.dds.nodes.run_loop import Timeline, run_until_signal
from roletrust_manager.dds.rounds import RoundTiming
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.topics import IMAGES, RATINGS, TRUST, owner
from roletrust_manager.journal.lines import JournalEntry
from roletrust_manager.team import Team, Trust

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
    admission, timing = Admission(StampLimits(10**9, 1)), RoundTiming(500_000_000)
    known = "sp_0", "sp_1"
    return AgentInbox(
        wire,
        IMAGES,
        messages.IMAGE,
        messages.read_picture_message,
        admission,
        known,
        strangers=strangers,
        timing=timing,
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
    assert made.refusals == {("participant mean", RefusalReason.CROWDED): 200 - MAX_STRANGERS}


def test_strangers_are_not_read_at_all_if_there_are_keys(clock):
    wire = FakeWire()
    made = readers(wire, strangers=False)
    made.update(wire.announce(IMAGES, messages.IMAGE, "z0", "sp_0", participant="mean"))
    made.update(wire.announce(IMAGES, messages.NUMBER, "sp_1"))
    assert names(made) == ["sp_0"]
    assert list(wire.readers) == [f"/sp_0{IMAGES}"]
    assert made.refusals == {("participant mean", RefusalReason.UNKNOWN): 1}


@pytest.mark.parametrize("keyed", [True, False])
@pytest.mark.parametrize(
    "fault", [RefusalReason.FLOOD, RefusalReason.GARBAGE, RefusalReason.ELSEWHERE]
)
def test_a_first_message_that_cannot_be_read_is_counted_under_its_name(fault, keyed):
    """A member of the team, with or without keys, before any of its messages was valid."""
    wire, raters = FakeWire(), ("sr_0", "sr_1")
    admission = Admission(StampLimits(10**9, 1), Names(raters) if keyed else None, members=raters)
    inbox = rating_inbox(wire, RoundTiming(PERIOD), admission, raters, strangers=not keyed)
    inbox.update(wire.announce(RATINGS, messages.RATINGS, "sr_1"))
    ratings = messages.encode(messages.ratings_message("sr_0", 5, {"sp_0": 0.5}))
    wire.waiting["/sr_1/ratings"] += {
        RefusalReason.GARBAGE: [b"?"],
        RefusalReason.ELSEWHERE: [ratings],
    }.get(fault, [])
    wire.readers["/sr_1/ratings"].excess = int(fault is RefusalReason.FLOOD)
    assert list(inbox.take(5)) == []
    assert inbox.refusals == {("sr_1", fault): 1}


class Names(frozenset):
    """A keyring that no message of these tests needs for more than its names."""


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
    """Another middleware may take more than five seconds to connect on a busy machine; it is
    announced all the time."""
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


PERIOD = 500_000_000


def rating(value, provider="sp_0", late=0):
    message = messages.ratings_message("sr_0", time.time_ns() + late * PERIOD, {provider: value})
    return messages.encode(message)


def test_trust_is_the_initial_one_until_some_is_published():
    subscription = TrustSubscription(FakeWire(), 0.7)
    subscription.update()
    assert (subscription.tor("sr_0"), subscription.top("sp_0")) == (0.7, 0.7)


def test_trust_of_long_rounds_is_not_from_the_past():
    """A round of a minute may close 66 seconds after its stamp."""
    wire, now, timing = FakeWire(), time.time_ns(), RoundTiming(60 * 10**9)
    subscription = TrustSubscription(wire, 0.7, limits=trust_limits(timing))
    for age in (timing.period * 3 // 2, 0):
        entry = JournalEntry(
            0, now - age, now, Team(("sr_0",), ("sp_0",)), {}, (), Trust((0.2,), (0.3,), ())
        )
        wire.waiting[TRUST].append(messages.encode(messages.trust_message(entry)))
        subscription.update()
        assert (subscription.tor("sr_0"), subscription.top("sp_0")) == (0.2, 0.3)
    assert not subscription.inbox.admission.refusals


@pytest.mark.parametrize(
    ("sent", "value", "rated"),
    [
        ([0.2, 0.4], 0.4, True),
        ([0.0], 0.0, True),
        ([1.0], 1.0, True),
        ([1.5], 0.0, False),
        ([-0.5], 0.0, False),
        ([float("nan")], 0.0, False),
        ([], 0.0, False),
    ],
)
def test_a_provider_reads_the_newest_valid_rating_of_each_rater(sent, value, rated):
    wire = FakeWire()
    subscription = RatingSubscription(wire, "sp_0", ("sr_0", "sr_1"), RoundTiming(PERIOD))
    ours = [rating(value, late=k) for k, value in enumerate(sent)]
    wire.waiting["/sr_0/ratings"] += [*ours, rating(0.9, "sp_1", len(sent)), b"garbage"]
    ratings, mask = subscription.take()
    np.testing.assert_array_equal(ratings, [value, 0.0])
    np.testing.assert_array_equal(mask, [rated, False])
    assert not subscription.take()[1].any()


def test_a_stamp_is_of_the_nearest_round():
    timeline = Timeline(1000, 100)
    assert [timeline.round(stamp) for stamp in (849, 850, 950, 1000, 1049, 1050, 1149)] == [
        -2,
        -1,
        0,
        0,
        0,
        1,
        1,
    ]
    assert timeline.begin(3) == 1300
    assert timeline.round(timeline.begin(3)) == 3


@pytest.mark.parametrize(
    ("now", "after", "following"),
    [(900, -1, 0), (500, -1, 0), (1000, -1, 0), (1300, 3, 4), (1900, 3, 9), (1310, 40, 4)],
)
def test_rounds_go_on_when_the_clock_was_set(now, after, following, monkeypatch):
    monkeypatch.setattr(run_loop.clock, "now", lambda: now)
    assert Timeline(1000, 100).next_round(after) == following


@pytest.mark.parametrize(("now", "start"), [(1000, 1100), (1001, 1100), (1099, 1100)])
def test_an_aligned_timeline_starts_with_the_next_whole_period(now, start, monkeypatch):
    monkeypatch.setattr(run_loop.clock, "now", lambda: now)
    assert Timeline.aligned(100) == Timeline(start, 100)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_a_node_and_its_sleep(number):
    before = signal.getsignal(number)
    with run_until_signal() as active:
        assert active
        signal.raise_signal(number)
        assert not active
        active.sleep_until(2**62)
    assert signal.getsignal(number) is before


@pytest.mark.parametrize(
    ("topic", "ending", "name"),
    [
        ("/sr_0/ratings", RATINGS, "sr_0"),
        ("/sp_0/image_raw/compressed", IMAGES, "sp_0"),
        ("/team/sr_0/ratings", RATINGS, None),
        ("sr_0/ratings", RATINGS, None),
        ("//ratings", RATINGS, None),
        ("/ratings", RATINGS, None),
    ],
)
def test_a_topic_has_the_owner_that_it_names(topic, ending, name):
    assert owner(topic, ending) == name


@pytest.mark.parametrize("pause", [1, 4, 12, 50])
def test_what_waited_in_a_pause_of_the_manager_counts(pause, tmp_path, monkeypatch):
    """It was once refused as from the past; a message of before the pause is still refused."""
    wire, now = FakeWire(), [100 * PERIOD]
    monkeypatch.setattr(inboxes.clock, "now", lambda: now[0])
    keeper = manager(tmp_path / "journal")
    inbox = rating_inbox(
        wire, RoundTiming(PERIOD), keeper.admission, keeper.known_raters, strangers=True
    )
    inbox.update(wire.announce(RATINGS, messages.RATINGS, *TEAM.raters))
    entries = []

    def send(*rounds, names=TEAM.raters):
        for name in names:
            sent = [messages.ratings_message(name, r * PERIOD, {"sp_0": 0.5}) for r in rounds]
            wire.waiting[f"/{name}/ratings"] += map(messages.encode, sent)

    def turn():
        for message in inbox.read():
            entries.extend(keeper.receive(message, now[0], inbox.arrival(message.envelope, now[0])))
        entries.extend(keeper.tick(now[0]))

    for r in range(100, 104):
        now[0] = r * PERIOD + PERIOD // 10
        send(r)
        turn()
    now[0] += pause * PERIOD
    last = 104 + pause
    send(*range(103, last - 1))
    send(last - 1, names=TEAM.raters[:2])
    turn()
    now[0] += PERIOD * 2 // 3  # the last rater is slow: the newest round stays open for it
    turn()
    send(last - 1, names=TEAM.raters[2:])
    turn()
    assert [(entry.stamp // PERIOD, len(entry.ratings)) for entry in entries] == [
        (r, 3) for r in range(100, last)
    ]
    assert keeper.admission.refusals == {(name, RefusalReason.REPLAYED): 1 for name in TEAM.raters}


def test_a_flood_is_counted_once():
    wire = FakeWire()
    made = readers(wire)
    made.update(wire.announce(IMAGES, messages.IMAGE, "sp_0"))
    wire.waiting[f"/sp_0{IMAGES}"].append(
        messages.encode(messages.picture_message(5, "sp_0", b"jpeg"))
    )
    wire.readers[f"/sp_0{IMAGES}"].excess = 7
    assert [picture.jpeg for picture in made.take(5)] == [b"jpeg"]
    assert list(made.take(5)) == []
    assert made.admission.refusals == {("sp_0", RefusalReason.FLOOD): 7}


def test_ratings_on_the_topic_of_another_are_refused():
    wire, admission = FakeWire(), Admission(StampLimits(10**9, 1), last_stamps={"sr_1": 0})
    inbox = rating_inbox(wire, RoundTiming(PERIOD), admission, ("sr_0", "sr_1"), strangers=False)
    inbox.update(wire.announce(RATINGS, messages.RATINGS, "sr_1"))
    for rater in ("sr_0", "sr_1"):
        wire.waiting["/sr_1/ratings"].append(
            messages.encode(messages.ratings_message(rater, 5, {"sp_0": 0.5}))
        )
    assert [message.envelope.sender for message in inbox.take(5)] == ["sr_1"]
    assert admission.refusals == {("sr_1", RefusalReason.ELSEWHERE): 1}


def test_a_sender_may_send_ten_messages_a_period_and_at_least_ten_a_second():
    assert [
        RoundTiming(period).quota for period in (10**8, 300_000_000, 5 * 10**8, 10**9, 10**10)
    ] == [
        100,
        34,
        20,
        10,
        10,
    ]
