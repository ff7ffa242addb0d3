"""A participant without keys forges trust, managers and ratings: nothing displayed, nothing
displaced, each counted."""

import os
import time
import uuid

import numpy as np
import pytest
import rtps_forger
from loopback import PERIOD, TEAM, team, until

from roletrust_manager.admission.keys import PublicKeys, Signer, make_keys
from roletrust_manager.admission.validation import MANAGER, RefusalReason
from roletrust_manager.dds.nodes.team_listener import TeamListener
from roletrust_manager.dds.rounds import RoundTiming
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.dds import Node
from roletrust_manager.journal.lines import read_journal

pytestmark = pytest.mark.live
__all__ = ["team"]

VICTIM, LIE = "sr_0", 0.01


@pytest.fixture(scope="module")
def page(team):
    """Open a page, and wait until it shows rounds."""
    made = TeamListener(TEAM, RoundTiming(PERIOD), keyring=PublicKeys(team.keys))
    until(lambda: made.rounds, "the page shows nothing")
    yield made
    made.close()


@pytest.fixture(scope="module")
def guids(team):
    """Return the identifiers of the true writers by topic, from before there are others."""
    topics = "/trust", f"/{VICTIM}/ratings"
    until(
        lambda: all(len(team.node.writers_of(topic)) == 1 for topic in topics),
        "earlier writers have not gone",
    )
    return {topic: uuid.UUID(*team.node.writers_of(topic)).bytes for topic in topics}


@pytest.fixture
def forger(guids):
    return Node("forger")


def false_trust(stamp):
    """Return a message that claims a low trust in a round that is far away."""
    tor, top, none = np.full(3, LIE), np.full(3, LIE), np.empty(0)
    names = {
        "raters": list(TEAM.raters),
        "providers": list(TEAM.providers),
        "both": [],
        "missing": [],
    }
    numbers = {"tor": tor, "top": top, "toa": none, "signature": np.empty(0, np.uint8)}
    return messages.make(
        messages.TRUST, header=messages.header(stamp), round=10039, **names, **numbers
    )


def next_stamp():
    """Return a stamp that is later than those of the last messages, as that of a true message may
    be."""
    return (time.time_ns() // PERIOD + 2) * PERIOD


def false_ratings(true):
    """Return forged messages of a rater by the reason of their refusal, from a true message of the
    rater."""
    bad = dict.fromkeys(TEAM.providers, LIE)
    altered = messages.decode(true, messages.RATINGS)
    altered.header, altered.values = messages.header(next_stamp()), np.full(3, LIE)
    return {
        RefusalReason.UNSIGNED: messages.encode(
            messages.ratings_message(VICTIM, next_stamp(), bad)
        ),
        RefusalReason.MIS_SIGNED: messages.encode(altered),
        RefusalReason.REPLAYED: true,
    }


def is_true(page, team):
    """Return whether the page shows the rounds of the journal and nothing else."""
    by_round = {entry.round: entry.published for entry in read_journal(team.journal)}
    return all(by_round[one.round] == one for one in page.rounds)


def refused(page, reason):
    return page.refusals.get((MANAGER, reason), 0)


def named(team, reason, rater=VICTIM):
    """Return how many messages of a rater the manager says it has refused."""
    return int(team.reports.get(f"{rater}: {reason}", 0))


def rated(team, first):
    """Return the journal's rounds from a published one on, and check that all their ratings are
    true."""
    entries = list(read_journal(team.journal))[team.heard[first][1].round :]
    for entry in entries:
        for name, row in entry.ratings.items():
            assert row in [values for (rater, _), values in team.values.items() if rater == name]
    return [entry for entry in entries if entry.stamp not in team.overdue]


def heard(reader):
    """Return the messages of a reader as soon as there are some."""
    found = []
    until(lambda: found.extend(reader.take()) or found, "the forger hears nothing")
    return found


def newest(reader, before):
    """Return the newest message of the rater itself: one that is old enough is refused for its age
    alone."""
    own = [raw for raw in reader.take() if LIE not in messages.read_ratings_message(raw).values]
    return own[-1] if own else before


def test_a_forged_manager_is_neither_displayed_nor_does_it_displace_one(team, page, forger):
    own, other = (
        forger.reader("/trust", messages.TRUST, depth=100),
        forger.reader("/diagnostics", messages.DIAGNOSTICS),
    )
    trust, reports = (
        forger.writer("/trust", messages.TRUST),
        forger.writer("/diagnostics", messages.DIAGNOSTICS),
    )
    old, said = heard(own), heard(other)
    for _ in range(20):
        now = time.time_ns()
        trust.write(false_trust(now))
        for raw in old:
            trust.write_raw(raw)
            changed = messages.decode(raw, messages.TRUST)
            changed.tor = np.full(len(changed.tor), LIE)
            trust.write(changed)
        reports.write(messages.diagnostics_message(now, MANAGER, False, {"writer": ""}, None))
        for raw in said:
            reports.write_raw(raw)
        time.sleep(0.1)
    team.wait_for(4)
    assert team.manager.is_alive()
    assert is_true(page, team)
    assert refused(page, RefusalReason.UNSIGNED) >= 20
    assert refused(page, RefusalReason.REPLAYED) + refused(page, RefusalReason.MIS_SIGNED) >= 20
    until(lambda: "manager: unsigned" in team.reports, "the manager does not name it")
    assert int(team.reports["other writers of trust"]) >= 1


def test_forged_ratings_cost_their_rater_no_round(team, forger, tmp_path):
    """They are unsigned, altered, replayed, or signed by a key of the forger's own."""
    make_keys(tmp_path, [VICTIM])
    voice = forger.writer(f"/{VICTIM}/ratings", messages.RATINGS)
    reader = forger.reader(f"/{VICTIM}/ratings", messages.RATINGS)
    true = heard(reader)[-1]
    first, before = len(team.heard) - 1, {reason: named(team, reason) for reason in RefusalReason}
    for _ in range(20):
        true = newest(reader, true)
        for raw in false_ratings(true).values():
            voice.write_raw(raw)
        lies = dict.fromkeys(TEAM.providers, LIE)
        voice.write(messages.ratings_message(VICTIM, next_stamp(), lies, Signer(tmp_path, VICTIM)))
        time.sleep(0.1)
    for reason, least in (
        (RefusalReason.UNSIGNED, 20),
        (RefusalReason.MIS_SIGNED, 40),
        (RefusalReason.REPLAYED, 20),
    ):
        until(lambda: named(team, reason) - before[reason] >= least, f"{reason} is not counted")  # noqa: B023
    found = rated(team, first)
    assert len(found) > 5
    assert all(set(TEAM.raters) <= entry.ratings.keys() for entry in found)
    assert team.manager.is_alive()


def test_packets_with_the_true_guid_of_the_manager_are_refused(team, page, guids):
    before, end = refused(page, RefusalReason.UNSIGNED), time.monotonic() + 60
    while refused(page, RefusalReason.UNSIGNED) == before and time.monotonic() < end:
        following = (
            sum(1 for _ in read_journal(team.journal)) + 1
        )  # the manager numbers its messages
        packet = messages.encode(false_trust(time.time_ns()))
        rtps_forger.send(
            guids["/trust"], following, packet, int(os.environ["ROS_DOMAIN_ID"]), count=12
        )
        time.sleep(0.1)
    team.wait_for(4)
    assert refused(page, RefusalReason.UNSIGNED) > before
    assert is_true(page, team)
    assert team.manager.is_alive()


def test_packets_with_the_true_guid_of_a_rater_are_refused(team, guids, forger):
    """The packets take the place of the rater's next messages, which are lost then; nothing false
    is rated."""
    topic = f"/{VICTIM}/ratings"
    reader = forger.reader(topic, messages.RATINGS)
    true = heard(reader)[-1]
    first, before = len(team.heard) - 1, {reason: named(team, reason) for reason in RefusalReason}
    end, reasons = time.monotonic() + 60, set(false_ratings(true))
    while any(named(team, one) == before[one] for one in reasons) and time.monotonic() < end:
        true = newest(reader, true)
        following = (
            sum(rater == VICTIM for rater, _ in team.values) + 1
        )  # the rater numbers its messages
        for place, raw in enumerate(false_ratings(true).values()):
            rtps_forger.send(
                guids[topic], following + 4 * place, raw, int(os.environ["ROS_DOMAIN_ID"]), count=4
            )
        time.sleep(0.1)
    assert {one for one in reasons if named(team, one) == before[one]} == set()
    found = rated(team, first)
    assert all({"sr_1", "sr_2"} <= entry.ratings.keys() for entry in found)
    assert team.manager.is_alive()
