import numpy as np
from random_arrivals import arrivals
from reference_synchroniser import slow_add, slow_start

from roletrust_manager.dds.synchroniser import ApproximateTimeSynchroniser, Message

PERIOD = 500
LATE = {"max_interval": 10**9}


def matches(sync, messages):
    """Return the stamps of the matches of messages (stream, stamp), in order."""
    found = []
    for at, (stream, stamp) in enumerate(messages):
        found += [step for step in sync.add(stream, Message(stamp, at, None)) if step.matched]
    return [tuple(message.stamp for message in step.messages) for step in found]


def test_equals_the_slow_reference_on_random_arrivals():
    for seed in range(500):
        check_against_the_slow_reference(np.random.default_rng(seed))


def check_against_the_slow_reference(random):
    streams = int(random.integers(1, 6))
    rules = {
        "interval": int(random.choice([50, 250, 10**9])),
        "bound": int(random.choice([0, 100, 400])),
        "penalty": float(random.choice([0.0, 0.1, 1.0])),
        "size": int(random.choice([1, 2, 5, 100])),
    }
    sync = ApproximateTimeSynchroniser(
        streams,
        max_interval=rules["interval"],
        lower_bound=rules["bound"],
        age_penalty=rules["penalty"],
        queue_size=rules["size"],
    )
    slow = slow_start(streams)
    for at, (stream, stamp) in enumerate(arrivals(random, streams)):
        got = [step for step in sync.add(stream, Message(stamp, at, at)) if step.matched]
        slow, wanted = slow_add(slow, stream, stamp, **rules)
        assert [tuple(message.stamp for message in step.messages) for step in got] == wanted
        waiting = sorted((message.stamp for _, message in sync.waiting()))
        assert waiting == sorted(stamp for stamps in slow.streams for stamp in stamps)


def test_every_message_is_in_one_match_or_lost_or_still_waiting():
    for seed in range(20):
        check_every_message(np.random.default_rng(seed))


def check_every_message(random):
    sync = ApproximateTimeSynchroniser(3, max_interval=200, lower_bound=300, queue_size=4)
    added, decided = [], []
    for at, (stream, stamp) in enumerate(arrivals(random, 3)):
        added.append((stream, at))
        for step in [
            *sync.add(stream, Message(stamp, at, at)),
            *(sync.publish_candidate() if at % 7 == 0 else []),
        ]:
            decided += [
                (number, message.arrival)
                for number, message in zip(step.streams, step.messages, strict=True)
            ]
    decided += [(number, message.arrival) for number, message in sync.waiting()]
    assert sorted(decided) == sorted(added)


def test_without_bounds_a_match_waits_for_the_next_round():
    first, second = [(0, 0), (1, 3), (2, 5)], [(0, 500), (1, 503), (2, 505)]
    assert matches(ApproximateTimeSynchroniser(3, **LATE), first) == []
    assert matches(ApproximateTimeSynchroniser(3, **LATE), first + second[:2]) == [(0, 3, 5)]


def test_with_a_lower_bound_it_does_not():
    assert matches(
        ApproximateTimeSynchroniser(3, max_interval=250, lower_bound=400), [(0, 0), (1, 3), (2, 5)]
    ) == [(0, 3, 5)]


def test_a_stream_that_stops_stops_everything():
    alive = [(stream, PERIOD * r) for r in range(1, 20) for stream in (0, 1)]
    assert matches(
        ApproximateTimeSynchroniser(3, max_interval=250, lower_bound=400),
        [(0, 0), (1, 0), (2, 0), *alive],
    ) == [(0,) * 3]


def test_a_narrower_match_replaces_the_candidate_unless_it_is_much_later():
    stamps = [(0, 0), (1, 90), (0, 100), (1, 600)]
    assert matches(ApproximateTimeSynchroniser(2, **LATE), stamps) == [(100, 90)]
    assert matches(ApproximateTimeSynchroniser(2, **LATE, age_penalty=10), stamps) == [(0, 90)]


def test_a_stream_that_dropped_is_no_pivot_until_another_moved_on():
    sync = ApproximateTimeSynchroniser(2, **LATE, lower_bound=80, queue_size=2)
    assert (
        matches(sync, [(1, 100), (1, 200), (1, 300)]) == []
    )  # the message of 100, which would match best, is dropped
    assert matches(sync, [(0, 110), (0, 210)]) == [(210, 200)]


def test_the_candidate_is_published_on_demand():
    sync = ApproximateTimeSynchroniser(2, **LATE)
    assert matches(sync, [(0, 0), (1, 5)]) == []
    (step,) = sync.publish_candidate()
    assert [message.stamp for message in step.messages] == [0, 5]
    assert sync.waiting() == sync.publish_candidate() == []
