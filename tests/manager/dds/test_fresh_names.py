"""A flood of fresh names without keys on real middleware: it is named and cut off, and the team
loses no round."""

import time
from collections import deque

import pytest
from loopback import PERIOD, TEAM, Raters, keys, managed, own_domain, process, until
from process_load import cpu_s

from roletrust_manager.admission.validation import MAX_STRANGERS
from roletrust_manager.dds.nodes.run_loop import run_until_signal
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.dds import Node
from roletrust_manager.journal.lines import read_journal

__all__ = ["keys", "own_domain"]

A_MINUTE, STAY = 1000, 100  # fresh names, and how many of them are there at a time


def fresh_names():
    """Run one participant with a rater of a new name 1000 times a minute, each of which rates for
    six seconds."""
    node, voices, number = Node("stranger", "/strange"), deque(maxlen=STAY), 0
    begin = time.time_ns()
    with run_until_signal() as active:
        while active:
            name = f"x{number}"
            voices.append(
                (name, node.writer(f"/{name}/ratings", messages.RATINGS))
            )  # the oldest is deleted
            stamp = time.time_ns() // PERIOD * PERIOD
            for one, voice in list(voices):
                voice.write(
                    messages.ratings_message(one, stamp, dict.fromkeys(TEAM.providers, 0.0))
                )
            number += 1
            active.sleep_until(begin + number * 60_000_000_000 // A_MINUTE)


@pytest.mark.parametrize(
    "seconds", [pytest.param(8, marks=pytest.mark.live), pytest.param(60, marks=pytest.mark.soak)]
)
def test_the_team_loses_no_round(seconds, tmp_path, keys):
    rounds = seconds * 10**9 // PERIOD
    with Raters(keys) as raters:
        manager = managed(tmp_path, keys=None)
        raters.wait_for(4)
        _, usual = measured(raters, manager, rounds // 4)
        stranger = process(fresh_names)
        until(lambda: flood(raters), "the flood is not named")
        first, during = measured(raters, manager, rounds)
        last = len(raters.heard)
        stranger.kill()
        stranger.join()
        _, after = measured(raters, manager, rounds // 4)
        manager.terminate()
        manager.join()
        counted = flood(raters)
    entries = list(read_journal(tmp_path / "journal"))
    raters.agrees_with(entries)
    found = [
        one
        for one in entries[raters.heard[first][1].round : last]
        if one.stamp not in raters.overdue
    ]
    print(
        f"CPU time of the manager a round: {usual:.4f} s before, {during:.4f} s during, "
        f"{after:.4f} s after"
    )
    print(f"{len(entries[-1].team.raters) - 3} strangers rated; {counted} names were turned away")
    assert len(found) > 0.9 * rounds
    assert all(set(TEAM.raters) <= entry.ratings.keys() for entry in found)
    assert len(entries[-1].team.raters) <= len(TEAM.raters) + MAX_STRANGERS
    assert counted > A_MINUTE * seconds / 60 / 2


def flood(raters):
    """Return how many topics of a participant the manager says it has not read."""
    names = [
        key
        for key in raters.reports
        if key.startswith("participant ") and key.endswith("too many newcomers")
    ]
    return sum(int(raters.reports[key]) for key in names)


def measured(raters, manager, rounds):
    """Return the place of the first of some further rounds, and the manager's CPU time a round."""
    first, before = len(raters.heard), cpu_s(manager.pid)
    raters.wait_for(rounds)
    return first, (cpu_s(manager.pid) - before) / rounds
