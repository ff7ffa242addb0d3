"""Silent, late, wrongly stamped and flooding raters on real middleware: the other raters lose nothing."""

import numpy as np
import pytest
from loopback import TEAM, Raters, keys, managed, own_domain, until

from roletrust_env.live.journal import read_journal

pytestmark = pytest.mark.live
__all__ = ["keys", "own_domain"]

SECOND = 1_000_000_000


@pytest.fixture
def raters(tmp_path, keys):
    """Start raters and a manager, and wait for the first rounds."""
    with Raters(keys) as made:
        process = managed(tmp_path)
        made.wait_for(4)
        yield made
        process.terminate()
        process.join()


def entries(folder, raters, first):
    """Return the journal's rounds from a published one on, and check that no gap is longer than two rounds."""
    kept = list(read_journal(folder / "journal"))
    raters.agrees_with(kept)
    found = kept[raters.heard[first][1].round :]
    sent = sorted({stamp for (name, stamp), delay in raters.sent.items() if delay is not None and name == "sr_0"})
    places = np.searchsorted(sent, [entry.stamp for entry in found])
    assert np.diff(places).max() <= 2  # rounds that were sent: on a busy machine, raters skip some
    return [entry for entry in found if entry.stamp not in raters.overdue]


def share(found, name):
    """Return the share of the rounds that have ratings of a rater."""
    assert len(found) > 5
    return np.mean([name in entry.ratings for entry in found])


def test_a_rater_that_vanishes_and_comes_back(tmp_path, raters):
    first = len(raters.heard) - 1
    raters.silent = {"sr_1"}
    raters.wait_for(12)
    raters.silent = set()
    raters.wait_for(8)
    found = entries(tmp_path, raters, first)
    assert 1 <= sum("sr_1" in entry.missing for entry in found) <= 6
    assert sum("sr_1" not in entry.ratings for entry in found) >= 8
    assert {"sr_0", "sr_1"} <= found[-2].ratings.keys()


def test_ratings_that_are_lost_or_late(tmp_path, raters):
    first = len(raters.heard) - 1
    raters.lost, raters.late = 0.1, 0.2
    raters.wait_for(40)
    raters.lost = raters.late = 0.0
    raters.wait_for(4)
    sent = dict(raters.sent)
    there = [(name, entry) for entry in entries(tmp_path, raters, first) for name in TEAM.raters]
    lost = [(name, entry) for name, entry in there if sent.get((name, entry.stamp), 0) is None]
    prompt = [(name, entry) for name, entry in there if sent.get((name, entry.stamp)) == 0]
    assert len(lost) > 3
    assert not any(name in entry.ratings for name, entry in lost)
    assert len(prompt) > 60
    assert np.mean([name in entry.ratings for name, entry in prompt]) > 0.95


@pytest.mark.parametrize("ahead", [-1, 1])
def test_a_clock_that_is_off_by_a_second(ahead, tmp_path, raters):
    raters.off = {"sr_2": ahead * SECOND}
    raters.wait_for(6)
    first = len(raters.heard) - 1
    raters.wait_for(16)
    found = entries(tmp_path, raters, first)
    assert share(found, "sr_0") == share(found, "sr_1") == 1
    named = sum(int(count) for key, count in raters.reports.items() if key.startswith("sr_2: "))
    assert named > 4 if ahead < 0 else "sr_2" in found[-1].ratings


def test_a_rater_that_floods_is_cut_off_and_named(tmp_path, raters):
    raters.flooded = {"sr_2"}
    until(lambda: "sr_2: too many messages" in raters.reports, "it is not named")
    first = len(raters.heard) - 1
    raters.wait_for(16)
    flooded = entries(tmp_path, raters, first)
    named = int(raters.reports["sr_2: too many messages"])
    raters.flooded = set()
    until(lambda: "sr_2" in list(read_journal(tmp_path / "journal"))[-1].ratings, "it stays cut off")
    assert share(flooded, "sr_0") == share(flooded, "sr_1") == 1
    assert share(flooded, "sr_2") <= 0.5
    assert named > 500
    assert not any(key.startswith(("sr_0", "sr_1")) for key in raters.reports)
