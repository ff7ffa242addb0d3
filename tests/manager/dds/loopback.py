"""The raters of a team on loopback, without robots. Tests make them silent, late, lossy or too
loud."""

import contextlib
import threading
import time

import numpy as np
import pytest
from domains import own_dds_domain
from fake_wire import FixedSigner

from roletrust_env.trust import make_trust_model
from roletrust_manager.admission.keys import Signer, make_keys
from roletrust_manager.admission.validation import MANAGER
from roletrust_manager.dds.nodes.manager_node import run_manager_node
from roletrust_manager.dds.nodes.run_loop import run_with_parent
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.dds import Node
from roletrust_manager.robots.processes import node_context
from roletrust_manager.team import Team

PERIOD = 250_000_000
TEAM = Team(("sr_0", "sr_1", "sr_2"), ("sp_0", "sp_1", "sp_2"))
PATIENCE_S = 120.0
FLOOD = 1000  # messages per second

NODES = node_context()
_started = []


@contextlib.contextmanager
def domain():
    """Use a DDS domain of this process, and stop all nodes at the end."""
    with own_dds_domain():
        try:
            yield
        finally:
            while _started:
                started = _started.pop()
                started.kill()
                started.join()


@pytest.fixture(autouse=True)
def own_domain():
    with domain():
        yield


@pytest.fixture
def keys(tmp_path):
    return made_keys(tmp_path)


@pytest.fixture(scope="module")
def team(tmp_path_factory):
    """Start raters and a manager for all tests of a module, and wait for the first rounds."""
    folder = tmp_path_factory.mktemp("team")
    with domain(), Raters(made_keys(folder)) as raters:
        raters.journal, raters.manager = folder / "journal", managed(folder)
        raters.wait_for(4)
        yield raters
        raters.manager.terminate()
        raters.manager.join()


def made_keys(folder):
    """Make the keys of the team, and return their folder."""
    make_keys(folder / "keys", [MANAGER, *TEAM.raters, *TEAM.providers])
    return folder / "keys"


def process(run, **arguments):
    """Start a process that runs a node."""
    made = NODES.Process(target=run_with_parent, args=(run,), kwargs=arguments, daemon=True)
    made.start()
    _started.append(made)
    return made


def managed(folder, **arguments):
    """Start a manager; the folder has its journal and the keys."""
    given = {
        "journal": folder / "journal",
        "period": PERIOD,
        "team": TEAM,
        "keys": folder / "keys",
        **arguments,
    }
    return process(run_manager_node, model=make_trust_model("role-trust"), **given)


class Listener(contextlib.AbstractContextManager):
    """Listens to a manager: its trust as (time, message), and its diagnostics."""

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
            self.heard += [
                (time.time_ns(), messages.decode(raw, messages.TRUST)) for raw in self._trust.take()
            ]
            for report in map(messages.read_diagnostics_message, self._diagnostics.take()):
                if report.envelope.sender == MANAGER:
                    self.reports = report.values

    def wait_for(self, rounds):
        """Wait for that many further rounds."""
        wanted = len(self.heard) + rounds
        until(lambda: len(self.heard) >= wanted, "rounds do not go on")

    def agrees_with(self, entries):
        """Check that every round was published once, with the trust of a complete journal."""
        by_round = {entry.round: entry for entry in entries}
        assert sorted(by_round) == list(range(len(entries)))
        assert len({said.round for _, said in self.heard}) == len(self.heard)
        for _, said in self.heard:
            assert by_round[said.round].stamp == messages.stamp_of(said)
            assert by_round[said.round].trust[:2] == (
                tuple(said.tor.tolist()),
                tuple(said.top.tolist()),
            )


def until(holds, why):
    end = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < end, why
        time.sleep(0.02)


class Raters(Listener):
    """Raters that rate every round, each on its own topic.

    Attributes:
        silent: Names of raters that send nothing.
        flooded: Names of raters that flood their own topics with invalid messages.
        off: Error of each rater's clock, nanoseconds.
        lost: Probability that a message is lost.
        late: Probability that a message is up to a period late.
        keys: Folder of their keys.
        sent: Delay of each message by (rater, stamp), seconds; None if it was lost.
        values: Ratings of each message by (rater, stamp), in the order of the providers.
        overdue: Times at which a message was due that a busy machine held back for half the
            manager's deadline.
    """

    def __init__(self, keys):
        super().__init__()
        self.keys, self.silent, self.flooded, self.off = keys, set(), set(), {}
        self.lost = self.late = 0.0
        self.sent, self.values, self.overdue = {}, {}, set()
        self._signers = {name: Signer(keys, name) for name in TEAM.raters}
        self._voices = {
            name: self.node.writer(f"/{name}/ratings", messages.RATINGS) for name in TEAM.raters
        }
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
                    if time.time_ns() - one[0] > 0.35 * PERIOD:
                        self.overdue.add(one[0])
                    waiting.remove(one)
                time.sleep(0.005)
            waiting += [
                (stamp + int(delay * 1e9), name, self._message(name, stamp))
                for name, delay in self._fate(stamp)
            ]

    def _fate(self, stamp):
        """Iterate over the raters of a round and the delays of their messages, seconds."""
        for name in TEAM.raters:
            lost, late, much = self._random.random(3)
            if name not in self.silent:
                delay = (
                    None if lost < self.lost else much * PERIOD / 1e9 if late < self.late else 0.0
                )
                self.sent[name, stamp + self.off.get(name, 0)] = delay
                if delay is not None:
                    yield name, delay

    def _message(self, name, stamp):
        values = self._random.random(3).tolist()
        ratings = dict(zip(TEAM.providers, values, strict=True))
        stamp += self.off.get(name, 0)
        self.values[name, stamp] = values
        return messages.ratings_message(name, stamp, ratings, self._signers[name])

    def _flood(self):
        while self.on:
            time.sleep(0.01)
            for name in tuple(self.flooded):
                nonsense = messages.encode(
                    messages.ratings_message(
                        name, time.time_ns(), {"sp_0": 0.0}, FixedSigner(b"x" * 64)
                    )
                )
                for _ in range(FLOOD // 100):
                    self._voices[name].write_raw(nonsense)
