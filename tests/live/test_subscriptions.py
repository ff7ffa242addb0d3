"""Subscriptions of nodes, start times of rounds, and signals. Without middleware."""

import signal
import time

import numpy as np
import pytest
from fake_wire import FakeWire

from roletrust_env.live.nodes import run_loop
from roletrust_env.live.nodes.inboxes import RatingSubscription, TrustSubscription
from roletrust_env.live.nodes.run_loop import Timeline, run_until_signal
from roletrust_env.live.rounds import RoundTiming
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.topics import IMAGES, RATINGS, owner

PERIOD = 500_000_000


def rating(value, provider="sp_0", late=0):
    message = messages.ratings_message("sr_0", time.time_ns() + late * PERIOD, {provider: value})
    return messages.encode(message)


def test_trust_is_the_initial_one_until_some_is_published():
    subscription = TrustSubscription(FakeWire(), 0.7)
    subscription.update()
    assert (subscription.tor("sr_0"), subscription.top("sp_0")) == (0.7, 0.7)


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
    assert [timeline.round(stamp) for stamp in (849, 850, 950, 1000, 1049, 1050, 1149)] == [-2, -1, 0, 0, 0, 1, 1]
    assert timeline.begin(3) == 1300
    assert timeline.round(timeline.begin(3)) == 3


@pytest.mark.parametrize(("now", "start"), [(1000, 1100), (1001, 1100), (1099, 1100)])
def test_an_aligned_timeline_starts_with_the_next_whole_period(now, start, monkeypatch):
    monkeypatch.setattr(run_loop.time, "time_ns", lambda: now)
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
