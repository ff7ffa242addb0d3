"""Silent, late, wrongly stamped and flooding raters on real middleware: the other raters lose
nothing."""

import time

import numpy as np
import pytest
from loopback import PERIOD, TEAM, team, until

from roletrust_manager.journal.lines import read_journal

pytestmark = pytest.mark.live
__all__ = ["team"]

SECOND = 1_000_000_000


@pytest.fixture
def raters(team):
    """Return the raters; after a test, they are as before, and all of them have rated some
    rounds."""
    yield team
    team.silent, team.flooded, team.off = set(), set(), {}
    team.lost = team.late = 0.0
    begin = time.time_ns() + PERIOD
    until(lambda: whole_since(team, begin) >= 4, "the raters do not come back")


def whole_since(raters, begin):
    """Return the number of rounds with all raters that began after a time."""
    entries = read_journal(raters.journal)
    return sum(
        entry.stamp > begin and set(TEAM.raters) <= entry.ratings.keys() for entry in entries
    )


def named(raters, name):
    """Return how often each refusal of a rater's messages has been counted so far."""
    return {key: int(count) for key, count in raters.reports.items() if key.startswith(f"{name}: ")}


def entries(raters, first):
    """Return the journal's rounds from a published one on, and check that no gap is longer than two
    rounds."""
    entries = list(read_journal(raters.journal))
    raters.agrees_with(entries)
    found = entries[raters.heard[first][1].round :]
    sent = sorted(
        {
            stamp
            for (name, stamp), delay in raters.sent.items()
            if delay is not None and name == "sr_0"
        }
    )
    places = np.searchsorted(sent, [entry.stamp for entry in found])
    assert np.diff(places).max() <= 2  # rounds that were sent: on a busy machine, raters skip some
    return [entry for entry in found if entry.stamp not in raters.overdue]


def share(found, name):
    """Return the share of the rounds that have ratings of a rater."""
    assert len(found) > 5
    return np.mean([name in entry.ratings for entry in found])


def test_a_rater_that_vanishes_and_comes_back(raters):
    first = len(raters.heard) - 1
    raters.silent = {"sr_1"}
    raters.wait_for(12)
    begin, raters.silent = time.time_ns() + PERIOD, set()
    raters.wait_for(8)
    found = entries(raters, first)
    back = [
        stamp
        for (name, stamp), _ in sorted(raters.sent.items())
        if name == "sr_1" and stamp > begin
    ][:2]
    assert all("sr_1" in entry.ratings for entry in found if entry.stamp in back)
    assert 1 <= sum("sr_1" in entry.missing for entry in found) <= 6
    assert sum("sr_1" not in entry.ratings for entry in found) >= 8
    assert {"sr_0", "sr_1"} <= found[-2].ratings.keys()


def test_ratings_that_are_lost_or_late(raters):
    first = len(raters.heard) - 1
    raters.lost, raters.late = 0.1, 0.2
    raters.wait_for(40)
    raters.lost = raters.late = 0.0
    raters.wait_for(4)
    sent = dict(raters.sent)
    there = [(name, entry) for entry in entries(raters, first) for name in TEAM.raters]
    lost = [(name, entry) for name, entry in there if sent.get((name, entry.stamp), 0) is None]
    prompt = [(name, entry) for name, entry in there if sent.get((name, entry.stamp)) == 0]
    assert len(lost) > 3
    assert not any(name in entry.ratings for name, entry in lost)
    assert len(prompt) > 60
    assert np.mean([name in entry.ratings for name, entry in prompt]) > 0.95


@pytest.mark.parametrize("ahead", [-1, 1])
def test_a_clock_that_is_off_by_a_second(ahead, raters):
    before = sum(named(raters, "sr_2").values())
    raters.off = {"sr_2": ahead * SECOND}
    raters.wait_for(6)
    first = len(raters.heard) - 1
    raters.wait_for(16)
    found = entries(raters, first)
    assert share(found, "sr_0") == share(found, "sr_1") == 1
    refused = sum(named(raters, "sr_2").values()) - before
    assert refused > 4 if ahead < 0 else "sr_2" in found[-1].ratings


def test_a_rater_that_floods_is_cut_off_and_named(raters):
    flood, before, others = (
        "sr_2: too many messages",
        named(raters, "sr_2"),
        named(raters, "sr_0") | named(raters, "sr_1"),
    )
    raters.flooded = {"sr_2"}
    until(lambda: named(raters, "sr_2").get(flood, 0) > before.get(flood, 0), "it is not named")
    first = len(raters.heard) - 1
    raters.wait_for(16)
    flooded = entries(raters, first)
    refused = named(raters, "sr_2")[flood] - before.get(flood, 0)
    raters.flooded = set()
    until(lambda: "sr_2" in list(read_journal(raters.journal))[-1].ratings, "it stays cut off")
    assert share(flooded, "sr_0") == share(flooded, "sr_1") == 1
    assert share(flooded, "sr_2") <= 0.5
    assert refused > 500
    assert named(raters, "sr_0") | named(raters, "sr_1") == others
