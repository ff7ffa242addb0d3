"""Processes that are killed: rounds go on, and nothing that was said is lost or changes."""

import contextlib
import multiprocessing
import os
import threading
import time

import numpy as np
import pytest

from roletrust_env.live.journal import read_journal
from roletrust_env.live.nodes.manage import run_manager
from roletrust_env.live.standing import Team
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node
from roletrust_env.live.wire.keys import Signer, make_keys
from roletrust_env.trust import make_trust_model

pytestmark = pytest.mark.live

PERIOD = 250_000_000
TEAM = Team(("sr_0", "sr_1", "sr_2"), ("sp_0", "sp_1", "sp_2"))
PATIENCE_S = 60.0


@pytest.fixture(autouse=True)
def _own_domain(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)


class Raters(contextlib.AbstractContextManager):
    """Raters that rate what nobody serves, each on a topic of its own, and somebody who listens to the manager."""

    def __init__(self, keys):
        self.silent, self.flooded = set(), set()
        self.heard = []
        self.on = True
        self._signers = {name: Signer(keys, name) for name in TEAM.raters}
        node = Node("raters")
        self._voices = {name: node.writer(f"/{name}/ratings", messages.RATINGS) for name in TEAM.raters}
        self._trust = node.reader("/trust", messages.TRUST, depth=1000)
        self._threads = [threading.Thread(target=self._rate), threading.Thread(target=self._flood)]
        for thread in self._threads:
            thread.start()

    def __exit__(self, *_):
        self.on = False
        for thread in self._threads:
            thread.join()

    def _rate(self):
        random = np.random.default_rng(0)
        while self.on:
            stamp = (time.time_ns() // PERIOD + 1) * PERIOD
            time.sleep((stamp - time.time_ns()) / 1e9)
            for name, signer in self._signers.items():
                notes = dict(zip(TEAM.providers, random.random(3).tolist(), strict=True))
                if name not in self.silent:
                    signature = signer.sign(messages.encode(messages.ratings_message(name, stamp, notes)))
                    self._voices[name].write(messages.ratings_message(name, stamp, notes, signature))
            self.heard += [(time.time_ns(), messages.decode(raw, messages.TRUST)) for raw in self._trust.take()]

    def _flood(self):
        while self.on:
            for name in tuple(self.flooded):
                self._voices[name].write(messages.ratings_message(name, time.time_ns(), {"sp_0": 0.0}, b"x" * 64))
            time.sleep(0.001)

    def wait_for(self, rounds):
        """Until so many more rounds were published."""
        wanted, end = len(self.heard) + rounds, time.monotonic() + PATIENCE_S
        while len(self.heard) < wanted:
            assert time.monotonic() < end, "rounds do not go on"
            time.sleep(0.02)


def start(folder):
    """A manager as a process."""
    arguments = {"period": PERIOD, "team": TEAM, "keys": folder / "keys"}
    process = multiprocessing.get_context("spawn").Process(
        target=run_manager, args=(make_trust_model("role-trust"), folder / "journal"), kwargs=arguments, daemon=True
    )
    process.start()
    return process


@pytest.fixture
def keys(tmp_path):
    make_keys(tmp_path / "keys", TEAM.raters)
    return tmp_path / "keys"


def test_a_manager_that_is_killed_again_and_again(tmp_path, keys):
    random = np.random.default_rng(0)
    with Raters(keys) as raters:
        for _ in range(10):
            process = start(tmp_path)
            raters.wait_for(4)
            time.sleep(random.uniform(0, 2 * PERIOD / 1e9))
            process.kill()
            process.join()
    kept = {entry.round: entry for entry in read_journal(tmp_path / "journal")}
    assert sorted(kept) == list(range(len(kept)))
    assert len({said.round for _, said in raters.heard}) == len(raters.heard) > 40
    for _, said in raters.heard:
        assert kept[said.round].stamp == messages.stamp_of(said)
        assert kept[said.round].trust.tor == tuple(said.tor.tolist())
        assert kept[said.round].trust.top == tuple(said.top.tolist())


def test_raters_that_vanish_and_come_back_and_one_that_is_drowned(tmp_path, keys):
    with Raters(keys) as raters:
        process = start(tmp_path)
        raters.wait_for(8)
        raters.silent = {"sr_1"}
        raters.wait_for(12)
        raters.silent = set()
        raters.wait_for(8)
        raters.flooded = {"sr_2"}
        raters.wait_for(20)
        process.terminate()
        process.join()
    entries = list(read_journal(tmp_path / "journal"))
    gaps = np.diff([entry.stamp for entry in entries]) / PERIOD
    assert gaps.max() <= 2.01  # on a machine that is not itself late, 1
    missing = ["".join(entry.missing) for entry in entries]
    assert 1 <= missing.count("sr_1") <= 6
    assert {"sr_0", "sr_1"} <= entries[-3].rows.keys()
    assert sum("sr_1" not in entry.rows for entry in entries) >= 8


def test_a_second_manager_is_told_so_in_one_line(tmp_path, keys):
    with Raters(keys) as raters:
        process = start(tmp_path)
        raters.wait_for(2)
        with pytest.raises(ValueError, match=r"another manager publishes /trust; stop it first"):
            run_manager(make_trust_model("role-trust"), tmp_path / "other", period=PERIOD, keys=keys)
        assert not (tmp_path / "other").exists()
        raters.wait_for(2)
        process.terminate()
        process.join()
