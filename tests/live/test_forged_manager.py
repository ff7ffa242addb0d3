"""A participant without keys that forges trust and managers: nothing displayed, nothing displaced, each counted."""

import os
import time
import uuid

import numpy as np
import pytest
import rtps_forger
from loopback import PERIOD, TEAM, Raters, keys, managed, own_domain, until

from roletrust_env.live.journal import read_journal
from roletrust_env.live.message_validation import MANAGER, RefusalReason
from roletrust_env.live.nodes.signatures import signed_diagnostics
from roletrust_env.live.nodes.team_listener import TeamListener
from roletrust_env.live.rounds import RoundTiming
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node
from roletrust_env.live.wire.keys import PublicKeys

pytestmark = pytest.mark.live
__all__ = ["keys", "own_domain"]


@pytest.fixture
def team(tmp_path, keys):
    """Start raters, a manager and a page, and wait for the first rounds."""
    with Raters(keys) as raters:
        manager = managed(tmp_path)
        raters.wait_for(3)
        page = TeamListener(TEAM, RoundTiming(PERIOD), keyring=PublicKeys(keys))
        until(lambda: page.rounds, "the page shows nothing")
        yield raters, manager, page
        page.close()
        manager.terminate()
        manager.join()


def lie(stamp):
    """Return a message that claims a low trust in a round that is far away."""
    tor, top, none = np.full(3, 0.01), np.full(3, 0.01), np.empty(0)
    names = {"raters": list(TEAM.raters), "providers": list(TEAM.providers), "both": [], "missing": []}
    numbers = {"tor": tor, "top": top, "toa": none, "signature": np.empty(0, np.uint8)}
    return messages.make(messages.TRUST, header=messages.header(stamp), round=10039, **names, **numbers)


def is_true(page, folder):
    """Return whether the page shows the rounds of the journal and nothing else."""
    kept = {entry.round: entry.published for entry in read_journal(folder / "journal")}
    return all(kept[one.round] == one for one in page.rounds)


def refused(page, reason):
    return page.refusals.get((MANAGER, reason), 0)


def test_a_forged_manager_is_neither_displayed_nor_does_it_displace_one(tmp_path, team):
    raters, manager, page = team
    node = Node("forger")
    own, other = node.reader("/trust", messages.TRUST, depth=100), node.reader("/diagnostics", messages.DIAGNOSTICS)
    trust, reports = node.writer("/trust", messages.TRUST), node.writer("/diagnostics", messages.DIAGNOSTICS)
    old, said = [], []
    until(lambda: old.extend(own.take()) or old, "the forger hears nothing")
    until(lambda: said.extend(other.take()) or said, "the forger hears nothing")
    for _ in range(20):
        now = time.time_ns()
        trust.write(lie(now))
        for raw in old:
            trust.write_raw(raw)
            changed = messages.decode(raw, messages.TRUST)
            changed.tor = np.full(len(changed.tor), 0.01)
            trust.write(changed)
        reports.write(signed_diagnostics(now, MANAGER, False, {"writer": ""}, None))
        for raw in said:
            reports.write_raw(raw)
        time.sleep(0.1)
    raters.wait_for(4)
    assert manager.is_alive()
    assert is_true(page, tmp_path)
    assert refused(page, RefusalReason.UNSIGNED) >= 20
    assert refused(page, RefusalReason.REPLAYED) + refused(page, RefusalReason.MIS_SIGNED) >= 20
    until(lambda: "manager: unsigned" in raters.reports, "the manager does not name it")
    assert int(raters.reports["other writers of trust"]) >= 1


def test_packets_with_the_true_guid_of_the_manager_are_refused(tmp_path, team):
    raters, manager, page = team
    node = Node("forger")
    until(lambda: node.writers_of("/trust"), "the forger finds no manager")
    guid = uuid.UUID(node.writers_of("/trust")[0]).bytes
    end = time.monotonic() + 60
    while not refused(page, RefusalReason.UNSIGNED) and time.monotonic() < end:
        following = sum(1 for _ in read_journal(tmp_path / "journal")) + 1  # the manager numbers its messages
        packet = messages.encode(lie(time.time_ns()))
        rtps_forger.send(guid, following, packet, int(os.environ["ROS_DOMAIN_ID"]), count=12)
        time.sleep(0.1)
    raters.wait_for(4)
    assert refused(page, RefusalReason.UNSIGNED)
    assert is_true(page, tmp_path)
    assert manager.is_alive()
