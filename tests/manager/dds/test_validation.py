"""Validation: which messages and ratings count, which newcomers join, and why the others are
refused."""

from collections import Counter
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from manager_cases import PERIOD, TEAM, feed, manager, random_ratings, rating_message

from roletrust_manager.admission import clock
from roletrust_manager.admission.validation import (
    MANAGER,
    MAX_STRANGERS,
    Admission,
    Envelope,
    Membership,
    RatingMessage,
    RefusalReason,
    StampLimits,
)

PROVIDERS = ("sp_0", "sp_1")
LIMITS = StampLimits(tolerance=2000, min_gap=500)
NOW = 10_000


class Signed:
    """Signatures for tests: the name, followed by the signed bytes."""

    def __init__(self, *names):
        self.names = names

    def __contains__(self, rater):
        return rater in self.names

    def verifies(self, rater, signed, signature):
        return signature == rater.encode() + signed


def ratings(values=(0.1, 0.9), providers=PROVIDERS, stamp=NOW, rater="sr_0", signature=b"sr_0text"):
    return RatingMessage(Envelope(rater, stamp, b"text", signature), providers, values)


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (ratings(rater="sr_9"), RefusalReason.UNKNOWN),
        (ratings(stamp=NOW + 2001), RefusalReason.FUTURE),
        (ratings(stamp=NOW - 2001), RefusalReason.PAST),
        (ratings(signature=b""), RefusalReason.UNSIGNED),
        (ratings(signature=b"sr_1text"), RefusalReason.MIS_SIGNED),
        (ratings(signature=b"sr_0other"), RefusalReason.MIS_SIGNED),
    ],
)
def test_invalid_messages_are_refused_as_a_whole(message, reason):
    admission = Admission(LIMITS, Signed("sr_0", "sr_1"))
    assert admission.admit(message, PROVIDERS, NOW) == (reason, {})
    assert admission.refusals == {("" if reason is RefusalReason.UNKNOWN else "sr_0", reason): 1}
    assert admission.admit(ratings(), PROVIDERS, NOW).ratings == {
        "sp_0": 0.1,
        "sp_1": 0.9,
    }  # its state is unchanged


@pytest.mark.parametrize(
    ("values", "providers", "reason"),
    [
        ((nan, 0.9), PROVIDERS, RefusalReason.NOT_A_NUMBER),
        ((inf, 0.9), PROVIDERS, RefusalReason.OUT_OF_RANGE),
        ((-0.01, 0.9), PROVIDERS, RefusalReason.OUT_OF_RANGE),
        ((1.01, 0.9), PROVIDERS, RefusalReason.OUT_OF_RANGE),
        ((0.1, 0.9), ("sp_7", "sp_1"), RefusalReason.UNKNOWN_PROVIDER),
        ((0.9, 0.1), ("sp_1", "sp_1"), RefusalReason.DOUBLED),
    ],
)
def test_invalid_ratings_are_refused_one_by_one(values, providers, reason):
    admission = Admission(LIMITS)
    assert admission.admit(ratings(values, providers), PROVIDERS, NOW).ratings == {"sp_1": 0.9}
    assert admission.refusals == {("sr_0", reason): 1}


@pytest.mark.parametrize("offset", [-2000, 2000])
def test_stamps_at_the_tolerance_are_accepted(offset):
    admission = Admission(LIMITS)
    assert admission.admit(ratings(stamp=NOW + offset), PROVIDERS, NOW).ratings == {
        "sp_0": 0.1,
        "sp_1": 0.9,
    }
    assert not admission.refusals


def test_ratings_at_the_bounds_are_accepted():
    assert Admission(LIMITS).admit(ratings((0.0, 1.0)), PROVIDERS, NOW).ratings == {
        "sp_0": 0.0,
        "sp_1": 1.0,
    }


def test_refusals_are_counted_one_by_one_or_many_at_once():
    admission = Admission(LIMITS, last_stamps={"sr_0": 0})
    admission.refuse("sr_0", RefusalReason.FLOOD, 7)
    admission.refuse("sr_0", RefusalReason.FLOOD)
    assert admission.refusals == {("sr_0", RefusalReason.FLOOD): 8}


def test_ratings_of_oneself_are_refused():
    admission = Admission(LIMITS)
    assert admission.admit(
        ratings((1.0, 0.5), ("srsp_0", "sp_0"), rater="srsp_0"), ("srsp_0", "sp_0"), NOW
    ).ratings == {"sp_0": 0.5}
    assert admission.refusals == {("srsp_0", RefusalReason.ITSELF): 1}


def test_stamps_rise_by_the_smallest_gap():
    admission = Admission(LIMITS, last_stamps={"sr_1": NOW})
    for stamp, reason in (
        (0, None),
        (0, RefusalReason.REPLAYED),
        (499, RefusalReason.TOO_SOON),
        (500, None),
        (100, RefusalReason.REPLAYED),
    ):
        admission.refusals.clear()
        assert bool(admission.admit(ratings(stamp=NOW + stamp), PROVIDERS, NOW).ratings) is (
            reason is None
        )
        assert admission.refusals == ({("sr_0", reason): 1} if reason else {})
    assert admission.admit(ratings(rater="sr_1"), PROVIDERS, NOW).ratings == {}


def test_when_the_clock_has_gone_back_a_sender_with_a_key_waits():
    hour, stamps = 3600 * 10**9, {"sr_0": NOW}
    for keys, reason in ((Signed("sr_0"), RefusalReason.CLOCK), (None, None)):
        admission = Admission(LIMITS, keys, stamps)
        assert bool(admission.admit(ratings(stamp=NOW - hour), PROVIDERS, NOW - hour).ratings) is (
            reason is None
        )
        assert admission.refusals == ({("sr_0", reason): 1} if reason else {})
    newcomers = Membership((), 10**9, {f"sr_{k}" for k in range(30)})
    for now in (NOW, NOW - hour):
        assert (
            sum(newcomers.admits(f"sr_{k}", now) for k in range(30) if f"sr_{k}" not in newcomers)
            == 10
        )


def test_the_clock_of_nodes_is_that_of_the_machine_but_for_small_steps_back(monkeypatch, caplog):
    """Each step: its end by real time, how far the machine's clock is ahead then, and by how much
    that of nodes is."""
    start, second, hour = clock.now(), 10**9, 3600 * 10**9
    for passed, ahead, expected in (
        (0, 0, 0),
        (1, hour, hour),  # set forward: nodes follow
        (11, 0, 0),  # set back by an hour
        (21, -20 * second, -5 * second),  # by less than a minute: half as fast
        (31, -20 * second, -10 * second),
        (61, -20 * second, -20 * second),  # for no longer than the error needs
        (62, 2 * hour, 2 * hour),
    ):
        monkeypatch.setattr(clock.time, "monotonic_ns", lambda passed=passed: passed * second)
        monkeypatch.setattr(
            clock.time,
            "time_ns",
            lambda passed=passed, ahead=ahead: start + passed * second + ahead,
        )
        if not passed:
            monkeypatch.setattr(clock, "_last", (0, start))
        assert clock.now() == start + passed * second + expected
    assert [record.args for record in caplog.records] == [(3600.0,)]


def test_unknown_names_take_no_memory():
    admission = Admission(LIMITS, Signed("sr_0"))
    for k in range(1000):
        admission.admit(ratings(rater=f"sr_x{k}"), PROVIDERS, NOW)
    assert admission.refusals == {("", RefusalReason.UNKNOWN): 1000}


def test_refused_messages_do_not_change_trust(tmp_path):
    random = np.random.default_rng(0)
    clean, noisy = manager(tmp_path / "clean"), manager(tmp_path / "noisy")
    values, mask = random_ratings(20, lost=0.0)
    wanted, got, sent = [], [], Counter()
    for r in range(20):
        wanted += feed(clean, values[r : r + 1], mask[r : r + 1], first=r + 1)
        got += feed(noisy, values[r : r + 1], mask[r : r + 1], first=r + 1)
        for _ in range(100):
            message, kind = wrong(random, r + 1)
            sent[kind] += 1
            got += noisy.receive(message, PERIOD * (r + 1) + 400_000_000)
    assert got == wanted
    counted = Counter()
    for (_, reason), times in noisy.admission.refusals.items():
        counted[reason] += times
    assert counted == sent


def wrong(random, round):
    """Return a message that must be refused, and the reason."""
    rater, values = (
        str(random.choice(TEAM.raters)),
        dict.fromkeys(TEAM.providers, float(random.random())),
    )
    message = rating_message(rater, round, values)
    kind = [
        RefusalReason.FUTURE,
        RefusalReason.PAST,
        RefusalReason.REPLAYED,
        RefusalReason.TOO_SOON,
    ][random.integers(4)]
    offset = {
        RefusalReason.FUTURE: int(random.integers(5 * PERIOD, 10**18)),
        RefusalReason.PAST: -int(random.integers(5 * PERIOD, 10**12)),
        RefusalReason.REPLAYED: 0,
        RefusalReason.TOO_SOON: int(random.integers(1, PERIOD // 2 - 1)),
    }[kind]
    return message._replace(envelope=Envelope(rater, message.envelope.stamp + offset)), kind


def test_members_always_take_part_and_strangers_up_to_a_limit():
    admission = Membership(["sr_0"], PERIOD)
    joined = [name for k in range(100) if admission.admits(name := f"x{k}", k * PERIOD)]
    assert joined == [f"x{k}" for k in range(MAX_STRANGERS)]
    assert admission.admits("sr_0", 0)
    assert admission.admits("x0", 0)
    assert "x0" in admission
    assert "x99" not in admission


def test_those_with_a_key_join_ten_a_period():
    admission = Membership([], PERIOD, {f"x{k}" for k in range(100)})
    joined = [
        sum(admission.admits(f"x{k}", now * PERIOD) for k in range(100)) for now in range(1, 12)
    ]
    assert joined == [10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 100]
    assert not admission.admits("other", 100 * PERIOD)


def test_a_flood_of_fresh_names_costs_the_others_no_round(tmp_path):
    """A thousand fresh names a minute without keys, at two rounds a second."""
    rounds, names = 40, 1000 * 40 // 120
    ratings, mask = random_ratings(rounds, lost=0.0)
    keeper, published = manager(tmp_path / "journal"), []
    for r in range(rounds):
        published += feed(keeper, ratings[r : r + 1], mask[r : r + 1], first=r + 1)
        for k in range(names // rounds):
            fresh = rating_message(f"x{r}_{k}", r + 1, {"sp_0": 0.0})
            published += keeper.receive(fresh, PERIOD * (r + 1) + 450_000_000)
    assert sum(set(TEAM.raters) <= entry.ratings.keys() for entry in published) == rounds
    assert len(published[-1].team.raters) <= len(TEAM.raters) + MAX_STRANGERS
    assert (
        keeper.admission.refusals["", RefusalReason.CROWDED]
        == names // rounds * rounds - MAX_STRANGERS
    )
    keeper.close()
    again = manager(tmp_path / "journal")
    assert (
        again.receive(rating_message("fresh", rounds + 1, {"sp_0": 0.0}), PERIOD * (rounds + 1))
        == []
    )
    strangers = len(published[-1].team.raters) - len(TEAM.raters)
    assert (again.admission.refusals["", RefusalReason.CROWDED] == 1) is (
        strangers == MAX_STRANGERS
    )


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("sr_0", None),
        ("sr_9", None),
        ("sp_0", RefusalReason.UNKNOWN),
        (MANAGER, RefusalReason.UNKNOWN),
        ("sr_8", RefusalReason.UNKNOWN),
    ],
)
def test_a_key_is_for_a_role_of_the_scenario(name, reason, tmp_path):
    """A camera of the scenario may not rate, and a rater of the scenario may not serve; a newcomer
    has either role."""
    keeper = manager(tmp_path / "journal", keyring=Signed("sr_0", "sr_9", "sp_0", MANAGER))
    message = RatingMessage(Envelope(name, PERIOD, b"", name.encode()), ["sp_1"], [0.5])
    keeper.receive(message, PERIOD)
    assert list(keeper.admission.refusals) == ([] if reason is None else [("", reason)])


HOUR = 3600 * 10**9
KEYS, BOTH = (True,), (True, False)
BASE = 2 * HOUR // PERIOD * PERIOD  # a time at which the clock can go back


def sent(stamp=BASE, rater="sr_0", signer=None, providers=("sp_0",), values=(0.5,)):
    return RatingMessage(
        Envelope(rater, stamp, b"text", f"{signer or rater}text".encode()), providers, values
    )


def unsigned(message):
    return message._replace(envelope=message.envelope._replace(signature=b""))


FAULTS = {
    RefusalReason.UNKNOWN: (KEYS, [], sent(rater="stranger")),
    RefusalReason.FUTURE: (BOTH, [], sent(BASE + 5 * PERIOD)),
    RefusalReason.PAST: (BOTH, [], sent(BASE - 5 * PERIOD)),
    RefusalReason.CLOCK: (KEYS, [sent(BASE + HOUR)], sent()),
    RefusalReason.REPLAYED: (BOTH, [sent()], sent()),
    RefusalReason.TOO_SOON: (BOTH, [sent()], sent(BASE + PERIOD // 4)),
    RefusalReason.UNSIGNED: (KEYS, [], unsigned(sent())),
    RefusalReason.MIS_SIGNED: (KEYS, [], sent(signer="sr_1")),
    RefusalReason.CROWDED: (BOTH, [sent(rater=f"x{k}") for k in range(10)], sent(rater="x10")),
    RefusalReason.ITSELF: (BOTH, [], sent(providers=("sr_0",))),
    RefusalReason.UNKNOWN_PROVIDER: (BOTH, [], sent(providers=("sp_7",))),
    RefusalReason.DOUBLED: (BOTH, [], sent(providers=("sp_0", "sp_0"), values=(0.5, 0.6))),
    RefusalReason.NOT_A_NUMBER: (BOTH, [], sent(values=(nan,))),
    RefusalReason.OUT_OF_RANGE: (BOTH, [], sent(values=(1.5,))),
}
"""Whether teams with keys and without have this reason, earlier messages, and a message with one
fault.

The rest of the reasons are tested with the inboxes, and with models whose state cannot grow.
"""

ONLY_OF_A_SERVICE = {RefusalReason.TOO_LARGE, RefusalReason.NO_WORK, RefusalReason.TAKEN}


@pytest.mark.parametrize(
    ("reason", "keyed"), [(one, keyed) for one in FAULTS for keyed in FAULTS[one][0]]
)
def test_a_single_fault_is_refused_for_its_own_reason(reason, keyed, tmp_path):
    """Under the name of the rater, also if none of its messages has been valid so far; strangers
    have none."""
    _, before, message = FAULTS[reason]
    names = [*TEAM.raters, *(f"x{k}" for k in range(20))]
    keeper = manager(tmp_path / "journal", keyring=Signed(*names) if keyed else None)
    for earlier in before:
        keeper.receive(earlier, earlier.envelope.stamp)
    keeper.admission.refusals.clear()
    keeper.receive(message, BASE)
    nameless = reason is RefusalReason.UNKNOWN or (reason is RefusalReason.CROWDED and not keyed)
    assert keeper.admission.refusals == {("" if nameless else message.envelope.sender, reason): 1}


def test_the_guide_has_every_reason_of_a_refusal():
    table = (
        (Path(__file__).parents[3] / "docs" / "guide" / "own-nodes.md")
        .read_text()
        .split("## Refusals")[1]
    )
    rows = " ".join(line.split("|")[1] for line in table.splitlines() if line.startswith("|"))
    assert [
        reason for reason in RefusalReason if reason not in ONLY_OF_A_SERVICE and reason not in rows
    ] == []


def test_a_provider_without_a_key_cannot_join_a_team_with_keys(tmp_path):
    keeper = manager(tmp_path / "journal", keyring=Signed("sr_0", "sr_1", "sp_9"))
    for name in ("sp_8", "sp_9", "sr_1"):
        keeper.add_provider(name, 0)
    keeper.receive(
        RatingMessage(
            Envelope("sr_0", PERIOD, b"", b"sr_0"), ["sp_8", "sp_9", "sr_1"], [0.0, 0.5, 1.0]
        ),
        PERIOD,
    )
    assert keeper.admission.refusals == {("sr_0", RefusalReason.UNKNOWN_PROVIDER): 2}
