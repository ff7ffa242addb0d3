from collections import Counter
from math import inf, nan

import numpy as np
import pytest
from manager_cases import PERIOD, TEAM, feed, luck, manager, said

from roletrust_env.live.rating_validation import Clock, Gate, Ratings, Reason

PROVIDERS = ("sp_0", "sp_1")
CLOCK = Clock(tolerance=2000, least=500)
NOW = 10_000


class Signed:
    """Signatures that a test can read: the name, then what is signed."""

    def __init__(self, *names):
        self.names = names

    def __contains__(self, rater):
        return rater in self.names

    def verifies(self, rater, signed, signature):
        return signature == rater.encode() + signed


def ratings(values=(0.1, 0.9), providers=PROVIDERS, stamp=NOW, rater="sr_0", signature=b"sr_0text"):
    return Ratings(rater, stamp, providers, values, b"text", signature)


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (ratings(values=(0.1,)), Reason.GARBAGE),
        (ratings(rater="sr_9"), Reason.UNKNOWN_RATER),
        (ratings(stamp=NOW + 2001), Reason.FUTURE),
        (ratings(stamp=NOW - 2001), Reason.PAST),
        (ratings(signature=b""), Reason.UNSIGNED),
        (ratings(signature=b"sr_1text"), Reason.MIS_SIGNED),
        (ratings(signature=b"sr_0other"), Reason.MIS_SIGNED),
    ],
)
def test_messages_that_are_refused_as_a_whole(message, reason):
    gate = Gate(CLOCK, Signed("sr_0", "sr_1"))
    assert gate.admit(message, PROVIDERS, NOW) == {}
    assert gate.refused == {("" if reason is Reason.UNKNOWN_RATER else "sr_0", reason): 1}
    assert gate.admit(ratings(), PROVIDERS, NOW) == {"sp_0": 0.1, "sp_1": 0.9}  # nothing has moved


@pytest.mark.parametrize(
    ("values", "providers", "reason"),
    [
        ((nan, 0.9), PROVIDERS, Reason.NOT_A_NUMBER),
        ((inf, 0.9), PROVIDERS, Reason.OUT_OF_RANGE),
        ((-0.01, 0.9), PROVIDERS, Reason.OUT_OF_RANGE),
        ((1.01, 0.9), PROVIDERS, Reason.OUT_OF_RANGE),
        ((0.1, 0.9), ("sp_7", "sp_1"), Reason.UNKNOWN_PROVIDER),
        ((0.9, 0.1), ("sp_1", "sp_1"), Reason.DOUBLED),
    ],
)
def test_ratings_that_are_refused_one_by_one(values, providers, reason):
    gate = Gate(CLOCK)
    assert gate.admit(ratings(values, providers), PROVIDERS, NOW) == {"sp_1": 0.9}
    assert gate.refused == {("sr_0", reason): 1}


def test_nobody_rates_itself():
    gate = Gate(CLOCK)
    assert gate.admit(ratings((1.0, 0.5), ("srsp_0", "sp_0"), rater="srsp_0"), ("srsp_0", "sp_0"), NOW) == {"sp_0": 0.5}
    assert gate.refused == {("srsp_0", Reason.ITSELF): 1}


def test_stamps_rise_by_their_least():
    gate = Gate(CLOCK, since={"sr_1": NOW})
    for stamp, reason in ((0, None), (0, Reason.REPLAYED), (499, Reason.TOO_SOON), (500, None), (100, Reason.REPLAYED)):
        gate.refused.clear()
        assert bool(gate.admit(ratings(stamp=NOW + stamp), PROVIDERS, NOW)) is (reason is None)
        assert gate.refused == ({("sr_0", reason): 1} if reason else {})
    assert gate.admit(ratings(rater="sr_1"), PROVIDERS, NOW) == {}


def test_names_that_nobody_knows_take_no_memory():
    gate = Gate(CLOCK, Signed("sr_0"))
    for k in range(1000):
        gate.admit(ratings(rater=f"sr_x{k}"), PROVIDERS, NOW)
    assert gate.refused == {("", Reason.UNKNOWN_RATER): 1000}


def test_trust_is_as_without_all_that_is_refused(tmp_path):
    random = np.random.default_rng(0)
    clean, noisy = manager(tmp_path / "clean"), manager(tmp_path / "noisy")
    notes, mask = luck(20, lost=0.0)
    wanted, got, sent = [], [], Counter()
    for r in range(20):
        wanted += feed(clean, notes[r : r + 1], mask[r : r + 1], first=r + 1)
        got += feed(noisy, notes[r : r + 1], mask[r : r + 1], first=r + 1)
        for _ in range(500):
            message, kind = wrong(random, r + 1)
            sent[kind] += 1
            got += noisy.hear(message, PERIOD * (r + 1) + 400_000_000)
    assert got == wanted
    counted = Counter()
    for (_, reason), times in noisy.gate.refused.items():
        counted[reason] += times
    assert counted == sent


def wrong(random, round):
    """A message that must move nothing, and why."""
    rater, notes = str(random.choice(TEAM.raters)), dict.fromkeys(TEAM.providers, float(random.random()))
    message = said(rater, round, notes)
    kind = [Reason.GARBAGE, Reason.FUTURE, Reason.PAST, Reason.REPLAYED, Reason.TOO_SOON][random.integers(5)]
    changed = {
        Reason.GARBAGE: {"values": tuple(random.random(int(random.choice([0, 1, 2, 4]))).tolist())},
        Reason.FUTURE: {"stamp": message.stamp + int(random.integers(5 * PERIOD, 10**18))},
        Reason.PAST: {"stamp": message.stamp - int(random.integers(5 * PERIOD, 10**12))},
        Reason.REPLAYED: {},
        Reason.TOO_SOON: {"stamp": message.stamp + int(random.integers(1, PERIOD // 2 - 1))},
    }[kind]
    return message._replace(**changed), kind
