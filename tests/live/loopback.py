"""A team's raters on loopback, without robots: they rate what nobody serves, and behave as badly as they are told."""

import contextlib
import multiprocessing
import os
import threading
import time

import numpy as np
import pytest

from roletrust_env.live.nodes.manager_node import run_manager_node
from roletrust_env.live.trust_tracker import Team
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node
from roletrust_env.live.wire.keys import Signer, make_keys
from roletrust_env.trust import make_trust_model

PERIOD = 250_000_000
TEAM = Team(("sr_0", "sr_1", "sr_2"), ("sp_0", "sp_1", "sp_2"))
PATIENCE_S = 120.0
FLOOD = 1000  # messages a second

# One server that has imported what nodes need; from there they start at once.
SPAWN = multiprocessing.get_context("forkserver")
SPAWN.set_forkserver_preload(
    [f"roletrust_env.live.nodes.{name}" for name in ("rater_node", "camera_node", "manager_node")]
)


_started = []


@pytest.fixture(autouse=True)
def own_domain(monkeypatch):
    """A domain in which nobody else is, and nobody is left after the test."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
    yield
    while _started:
        left = _started.pop()
        left.kill()
        left.join()


@pytest.fixture
def keys(tmp_path):
    make_keys(tmp_path / "keys", TEAM.raters)
    return tmp_path / "keys"


def process(run, **arguments):
    """A process that runs a node."""
    made = SPAWN.Process(target=run, kwargs=arguments, daemon=True)
    made.start()
    _started.append(made)
    return made


def managed(folder, **arguments):
    """A manager's process; its journal is in the folder, and the keys."""
    given = {"journal": folder / "journal", "period": PERIOD, "team": TEAM, "keys": folder / "keys", **arguments}
    return process(run_manager_node, model=make_trust_model("role-trust"), **given)


class Listener(contextlib.AbstractContextManager):
    """Hears a manager: trust, as (time, message), and what it reports."""

    def __init__(self):
        self.heard, self.reports, self.on = [], {}, True
        self.node = Node("listener")
        self._trust = self.node.reader("/trust", messages.TRUST, depth=1000)
        self._diagnostics = self.node.reader("/diagnostics", messages.DIAGNOSTICS)
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def __exit__(self, *_):
        self.on = False
        self._thread.join()

    def _listen(self):
        while self.on:
            time.sleep(0.01)
            self.heard += [(time.time_ns(), messages.decode(raw, messages.TRUST)) for raw in self._trust.take()]
            for raw in self._diagnostics.take():
                (status,) = messages.decode(raw, messages.DIAGNOSTICS).status
                self.reports = {pair.key: pair.value for pair in status.values}

    def wait_for(self, rounds):
        """Until so many more rounds were published."""
        wanted = len(self.heard) + rounds
        until(lambda: len(self.heard) >= wanted, "rounds do not go on")

    def agrees_with(self, entries):
        """See that no round was published twice, and each as it is in a journal that lacks none."""
        kept = {entry.round: entry for entry in entries}
        assert sorted(kept) == list(range(len(entries)))
        assert len({said.round for _, said in self.heard}) == len(self.heard)
        for _, said in self.heard:
            assert kept[said.round].stamp == messages.stamp_of(said)
            assert kept[said.round].trust[:2] == (tuple(said.tor.tolist()), tuple(said.top.tolist()))


def until(holds, why):
    end = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < end, why
        time.sleep(0.02)


class Raters(Listener):
    """Raters that rate round by round, each on a topic of its own.

    Attributes:
        silent: who says nothing.
        flooded: whose topics are drowned in nonsense, by themselves.
        off: how far the clock of a rater is off, nanoseconds.
        lost: the probability that a message is lost.
        late: the probability that one comes up to a period late.
        sent: (rater, stamp) of all messages, and how late each came, seconds; None if it was lost.
    """

    def __init__(self, keys):
        super().__init__()
        self.silent, self.flooded, self.off = set(), set(), {}
        self.lost = self.late = 0.0
        self.sent = {}
        self._signers = {name: Signer(keys, name) for name in TEAM.raters}
        self._voices = {name: self.node.writer(f"/{name}/ratings", messages.RATINGS) for name in TEAM.raters}
        self._random = np.random.default_rng(0)
        self._threads = [threading.Thread(target=work) for work in (self._rate, self._flood)]
        for thread in self._threads:
            thread.start()

    def __exit__(self, *failure):
        super().__exit__(*failure)
        for thread in self._threads:
            thread.join()

    def _rate(self):
        waiting = []
        while self.on:
            stamp = (time.time_ns() // PERIOD + 1) * PERIOD
            while (now := time.time_ns()) < stamp:
                for one in [one for one in waiting if one[0] <= now]:
                    self._voices[one[1]].write(one[2])
                    waiting.remove(one)
                time.sleep(0.005)
            waiting += [(stamp + int(delay * 1e9), name, self._said(name, stamp)) for name, delay in self._fate(stamp)]

    def _fate(self, stamp):
        """Who rates in a round, and how late it comes."""
        for name in TEAM.raters:
            lost, late, much = self._random.random(3)
            if name not in self.silent:
                delay = None if lost < self.lost else much * PERIOD / 1e9 if late < self.late else 0.0
                self.sent[name, stamp + self.off.get(name, 0)] = delay
                if delay is not None:
                    yield name, delay

    def _said(self, name, stamp):
        notes = dict(zip(TEAM.providers, self._random.random(3).tolist(), strict=True))
        stamp += self.off.get(name, 0)
        signature = self._signers[name].sign(messages.encode(messages.ratings_message(name, stamp, notes)))
        return messages.ratings_message(name, stamp, notes, signature)

    def _flood(self):
        while self.on:
            time.sleep(0.01)
            for name in tuple(self.flooded):
                nonsense = messages.encode(messages.ratings_message(name, time.time_ns(), {"sp_0": 0.0}, b"x" * 64))
                for _ in range(FLOOD // 100):
                    self._voices[name].write_raw(nonsense)
