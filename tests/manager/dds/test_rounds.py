from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from random_arrivals import arrivals

from roletrust_manager.dds.rounds import RoundAssembler, RoundTiming

PERIOD = 1000
TIMING = RoundTiming(PERIOD)


def play(messages, *, names=(), timing=TIMING, until=None, tick=50):
    """Return the rounds of messages (arrival, name, stamp), with frequent ticks."""
    rounds, closed = RoundAssembler(timing, names), []
    end = until or max(arrival for arrival, _, _ in messages) + 5 * timing.period
    queue = sorted(messages)
    for now in range(0, end, tick):
        while queue and queue[0][0] <= now:
            arrival, name, stamp = queue.pop(0)
            closed += [(arrival, round) for round in rounds.add(name, stamp, stamp, arrival)]
        closed += [(now, round) for round in rounds.close_due(now)]
    return closed, rounds


def rounds_of(names, sent, delay=10):
    """Return the messages of rounds; each round is a text of the names that send."""
    every = list(names)
    return [
        (PERIOD * r + delay + every.index(name), name, PERIOD * r)
        for r, heard in enumerate(sent, 1)
        for name in heard
    ]


def summary(closed):
    return [("".join(sorted(round.items)), "".join(sorted(round.missing))) for _, round in closed]


def test_a_complete_round_closes_at_once():
    closed, _ = play(rounds_of("abc", ["abc"] * 4), names="abc", tick=1)
    assert summary(closed) == [("abc", "")] * 4
    assert [now - round.stamp for now, round in closed] == [12] * 4


def test_a_partial_round_closes_at_the_deadline_and_names_the_missing():
    closed, _ = play(rounds_of("abc", ["abc", "ab", "bc", "abc", "a"]), names="abc", tick=1)
    assert summary(closed)[:5] == [("abc", ""), ("ab", "c"), ("bc", "a"), ("abc", ""), ("a", "bc")]
    assert [now - round.stamp for now, round in closed] == [12, 710, 711, 12, 710]


def test_silent_streams_are_not_expected_until_they_send_again():
    sent = ["abc"] * 3 + ["ab"] * 6 + ["abc"] * 3
    closed, rounds = play(rounds_of("abc", sent), names="abc", tick=1, until=13_500)
    assert summary(closed) == [(heard, "c" if k in (3, 4) else "") for k, heard in enumerate(sent)]
    assert [now - round.stamp for now, round in closed][3:10] == [710] * 6 + [12]
    assert rounds.expected == ("a", "b", "c")
    assert not rounds.unused


@pytest.mark.parametrize("start", [0, 4], ids=["at the start", "later"])
@pytest.mark.parametrize("rounds", [2, 7, 1100])
@pytest.mark.parametrize("delay", [1, 30, 690])
def test_the_first_message_after_a_silence_counts(delay, rounds, start):
    """It comes before those of the others, after them, or just before the deadline of the round."""
    others = rounds_of("ab", ["ab"] * (start + rounds + 2))
    stamps = [PERIOD * r for r in (*range(1, start + 1), start + rounds + 1, start + rounds + 2)]
    closed, assembler = play(
        others + [(stamp + delay, "c", stamp) for stamp in stamps], names="abc", tick=10
    )
    assert [round.items["c"] for _, round in closed if "c" in round.items] == stamps
    assert not assembler.unused


def test_after_a_long_absence_rounds_are_complete_without_a_stream():
    timing = RoundTiming(PERIOD, absence=20.0)
    sent = ["abc"] * 2 + ["ab"] * 28 + ["c"] + ["abc"] * 2
    closed, rounds = play(rounds_of("abc", sent), names="abc", timing=timing, tick=1, until=34_000)
    assert [now - round.stamp for now, round in closed] == [12] * 2 + [710] * 19 + [12] + [
        11
    ] * 8 + [712] + [12] * 2
    assert not rounds.unused


def test_new_streams_are_added():
    closed, _ = play(
        rounds_of("abcd", ["ab", "ab", "abc", "abcd", "abcd", "abcd"]), names="ab", tick=1
    )
    assert summary(closed) == [(heard, "") for heard in ("ab", "ab", "ab", "abc", "abcd", "abcd")]


def test_late_messages_are_counted_and_change_nothing():
    messages = rounds_of("ab", ["ab", "a", "ab"])
    closed, rounds = play([*messages, (2900, "b", 2000)], names="ab")
    assert summary(closed) == [("ab", ""), ("a", "b"), ("ab", "")]
    assert rounds.unused == Counter("b")


def test_a_stamp_from_the_future_takes_no_round_from_the_others():
    honest = rounds_of("ab", ["ab"] * 8)
    hasty = [(PERIOD * r + 5, "c", PERIOD * r + 1900) for r in range(1, 9)]
    closed, rounds = play(honest + hasty, names="abc", tick=10)
    of_the_honest = [
        round.items["a"] for _, round in closed if "a" in round.items and "b" in round.items
    ]
    assert of_the_honest == [PERIOD * r for r in range(1, 9)]
    assert not rounds.unused["a"] + rounds.unused["b"]


def test_silence_of_all_streams_closes_no_round():
    closed, rounds = play(rounds_of("ab", ["ab"] * 2), names="ab", until=60_000)
    assert len(closed) == 2
    assert rounds.expected == ()


def test_the_matching_one_of_two_messages_of_a_round_counts():
    messages = [
        (1000, "a", 1000),
        (1200, "a", 1200),
        (1210, "b", 1190),
        (2000, "a", 2000),
        (2000, "b", 2000),
    ]
    closed, rounds = play(messages, names="ab")
    assert [round.items for _, round in closed] == [{"a": 1200, "b": 1190}, {"a": 2000, "b": 2000}]
    assert rounds.unused == Counter("a")


def test_rounds_rise_and_each_message_is_in_at_most_one():
    for seed in range(100):
        check_random_arrivals(seed)


def check_random_arrivals(seed):
    random = np.random.default_rng(seed)
    names = "abcd"[: random.integers(1, 5)]
    messages = []
    for stream, stamp in arrivals(random, len(names), rounds=20, period=PERIOD):
        arrival = (
            stamp + random.exponential(300)
            if random.random() < 0.8
            else random.uniform(0, 20 * PERIOD)
        )
        messages.append((int(arrival), names[stream], stamp))
    closed, rounds = play(messages, names=names if seed % 2 else ())
    stamps = [round.stamp for _, round in closed]
    assert stamps == sorted(set(stamps))
    for _, round in closed:
        assert max(round.items.values()) - min(round.items.values()) <= TIMING.max_spread
        assert not set(round.missing) & set(round.items)
    used = Counter((name, stamp) for _, round in closed for name, stamp in round.items.items())
    sent = Counter((name, stamp) for _, name, stamp in messages)
    assert not used - sent
    assert used.total() + rounds.unused.total() == sent.total()  # each message is used or counted


def test_messages_half_a_period_apart_are_of_one_round():
    closed, rounds = play(
        [(1000, "a", 1000), (1010, "b", 1500), (1020, "c", 1501)], names="abcd", until=1800
    )
    assert [(round.items, round.missing) for _, round in closed] == [
        ({"a": 1000, "b": 1500}, ("c", "d"))
    ]
    assert not rounds.unused


def test_an_early_duplicate_half_a_period_before_the_match_is_of_its_round():
    closed, rounds = play([(1500, "a", 1000), (1505, "a", 1500), (1510, "b", 1500)], names="ab")
    assert [round.items for _, round in closed] == [{"a": 1500, "b": 1500}]
    assert rounds.unused == Counter("a")


@pytest.mark.parametrize(("after", "late"), [(500, True), (501, False)])
def test_half_a_period_after_a_closed_round_the_next_one_begins(after, late):
    closed, rounds = play(
        [(1000, "a", 1000), (1010, "b", 1000), (1600, "a", 1000 + after)], names="ab"
    )
    assert [round.items for _, round in closed][1:] == ([] if late else [{"a": 1000 + after}])
    assert rounds.unused == Counter("a" if late else "")


def test_a_complete_round_of_different_stamps_closes_at_once():
    sent = [
        (PERIOD * r + 10, name, PERIOD * r + k) for r in range(1, 5) for k, name in enumerate("abc")
    ]
    closed, _ = play(sent, names="abc", tick=1)
    assert [(now, round.stamp) for now, round in closed] == [
        (PERIOD * r + 10, PERIOD * r) for r in range(1, 5)
    ]


def test_the_limits_of_a_round_are_shares_of_its_period():
    assert (TIMING.max_spread, TIMING.tolerance) == (500, 4000)


@pytest.mark.parametrize(("stamps", "expected"), [((1000, 1500), ""), ((1500, 1000), "c")])
def test_messages_of_silent_streams_half_a_period_apart_are_of_one_round(stamps, expected):
    rounds = RoundAssembler(RoundTiming(PERIOD, deadline=5.0), "abc")
    assert rounds.add("a", stamps[0], stamps[0], 1000) == []
    assert rounds.add("c", stamps[1], stamps[1], 1600 if expected else 1000) == []
    closed = [round for now in (4500, 9000, 19_000) for round in rounds.close_due(now)]
    assert [round.items for round in closed] == [{"a": stamps[0], "c": stamps[1]}]
    assert not rounds.unused


def test_rounds_up_to_the_given_stamp_are_closed_already():
    rounds = RoundAssembler(TIMING, "a", after=1000)
    assert rounds.add("a", 1500, 0, 1500) == []
    assert [round.stamp for round in rounds.add("a", 1501, 0, 1501)] == [1501]


def test_a_stream_is_expected_until_its_silence_is_as_long_as_the_limit():
    rounds = RoundAssembler(TIMING, "ab")
    for name in "ab":
        rounds.add(name, 1000, 0, 1000)
    rounds.close_due(3999)
    assert rounds.expected == ("a", "b")
    rounds.close_due(4000)
    assert rounds.expected == ()


def test_the_deadline_of_an_early_message_counts_from_its_stamp():
    closed, rounds = play([(1000, "a", 2000)], names="ab", tick=1, until=2900)
    assert [(now, round.items) for now, round in closed] == [(2700, {"a": 2000})]
    rounds.close_due(4999)
    assert "a" in rounds.expected
    rounds.close_due(5000)
    assert "a" not in rounds.expected


def test_a_message_of_a_closed_round_takes_no_round_from_the_others():
    """The synchroniser matches 4500, which belongs to the round of 4000, with 5000; this once
    stopped the manager."""
    early = [(3300, "a", 4000), (4000, "a", 4500), (4500, "c", 4000), (4700, "b", 4000)]
    closed, rounds = play([*early, (5000, "b", 5000), (5000, "c", 5000)], names="abc")
    assert [round.items for _, round in closed] == [
        {"a": 4000, "b": 4000, "c": 4000},
        {"b": 5000, "c": 5000},
    ]
    assert rounds.unused == Counter("a")


def test_stamps_at_the_limits_lose_no_message():
    """All stamps are multiples of half a period, the largest difference within a round."""
    for seed in range(100):
        check_stamps_at_the_limits(seed)


def check_stamps_at_the_limits(seed):
    random = np.random.default_rng(seed)
    messages = []
    for r in range(1, 25):
        for name in "abc":
            if random.random() < 0.8:
                stamp = PERIOD * r + PERIOD // 2 * int(random.integers(-1, 3))
                messages.append((PERIOD * r + 100 * int(random.integers(0, 15)), name, stamp))
    closed, rounds = play(messages, names="abc" if seed % 2 else "")
    for _, round in closed:
        assert max(round.items.values()) - min(round.items.values()) <= TIMING.max_spread
    stamps = [round.stamp for _, round in closed]
    assert all(later - stamp > TIMING.max_spread for stamp, later in pairwise(stamps))
    assert sum(len(round.items) for _, round in closed) + rounds.unused.total() == len(messages)


@pytest.mark.parametrize("streams", [1, 3, 9, 40])
def test_rounds_have_the_messages_that_arrived(streams):
    random = np.random.default_rng(streams)
    names = [f"sr_{k}" for k in range(streams)]
    heard = random.random((60, streams)) < 0.9
    heard[:, 0] |= ~heard.any(axis=1)  # without a message there is no round
    messages = [
        (
            int(PERIOD * r + random.uniform(0, 300)),
            names[k],
            int(PERIOD * r + random.uniform(0, 30)),
        )
        for r in range(60)
        for k in range(streams)
        if heard[r, k]
    ]
    closed, _ = play(messages, names=names, timing=RoundTiming(PERIOD, silence=1000))
    assert [[name in round.items for name in names] for _, round in closed] == heard.tolist()
