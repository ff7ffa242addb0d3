"""The trust manager as a process: hears every rater, and publishes trust."""

import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from roletrust_env.live.journal import Entry
from roletrust_env.live.manager import Manager
from roletrust_env.live.nodes.running import SECOND, running
from roletrust_env.live.nodes.topics import DIAGNOSTICS, IMAGES, RATINGS, TRUST, owner
from roletrust_env.live.rating_validation import Reason
from roletrust_env.live.rounds import Patience
from roletrust_env.live.trust_tracker import Team
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Quota, Reader, Writer
from roletrust_env.live.wire.keys import PublicKeys
from roletrust_env.live.wire.recording import Recorded
from roletrust_env.trust import TrustModel

_DEPTH = 200  # messages of a rater that are kept while the manager is busy
_MOST = 10  # messages that a rater may send in a period; there is one to send
_MEETING_S = 1.0  # in which nodes of one machine find each other
_DIAGNOSED_S = 1.0  # between two reports on what was refused
_QUIET = 10  # periods without a word after which nothing is left to be closed
_ANOTHER = f"another manager publishes {TRUST}; stop it first, or set another ROS_DOMAIN_ID"


def run_manager(
    model: TrustModel[Any],
    journal: Path,
    *,
    period: int,
    team: Team | None = None,
    keys: Path | None = None,
    network: bool = False,
    tell: Callable[[str], None] = lambda line: print(line, file=sys.stderr, flush=True),
) -> None:
    """Be the manager until it is told to stop.

    Args:
        model: any trust model.
        journal: path of its journal; one that is there is gone on with.
        period: between rounds, nanoseconds.
        team: who is waited for from the start.
        keys: a folder with the raters' public keys; None believes everybody who says to be a rater.
        network: see `Node`.
        tell: where it says what a person should know.

    Raises:
        ValueError: there is another manager, or the journal is not one of such a manager; see `Manager`.
    """
    keyring = None if keys is None else PublicKeys(keys)
    node = Node("manager", network=network)
    time.sleep(_MEETING_S)
    found = node.discover()
    if any(other.topic == TRUST for other in found):
        raise ValueError(_ANOTHER)
    manager = Manager(model, journal, patience=Patience(period), team=team, keyring=keyring)
    if keyring is None:
        tell("manager: WITHOUT KEYS: whoever is on this network may rate in anybody's name")
    if manager.next_round:
        tell(f"manager: goes on with round {manager.next_round} of {journal}")
    office, raters = _Office(node), dict[str, Reader]()
    most = math.ceil(_MOST * SECOND / period)
    with running() as on:
        while on:
            for topic, kind in (*found, *node.discover()):
                if (name := owner(topic, RATINGS)) and kind == messages.RATINGS and name not in raters:
                    raters[name] = node.reader(topic, messages.RATINGS, depth=_DEPTH, quota=Quota(most))
                elif topic == TRUST and office.is_second:
                    raise ValueError(_ANOTHER)
                elif camera := owner(topic, IMAGES):
                    manager.meet(camera)
            found = []
            for name, reader in raters.items():
                for raw in reader.take():
                    office.publish(hear_raw(manager, name, raw, time.time_ns()))
                if reader.cut_off:
                    manager.gate.refuse(name, Reason.FLOOD, reader.cut_off)
                    reader.cut_off = 0
            office.publish(manager.tick(time.time_ns()))
            office.diagnose(manager)
            node.wait(period / SECOND / 20)
    manager.close()


def hear_raw(manager: Manager, name: str, raw: bytes, now: int) -> list[Entry]:
    """What a message leads to that came on a rater's topic at a time, nanoseconds; whatever its bytes are."""
    try:
        ratings = messages.read_ratings(raw)
    except ValueError:
        manager.gate.refuse(name, Reason.GARBAGE)
        return []
    if ratings.rater != name:
        manager.gate.refuse(name, Reason.ELSEWHERE)
        return []
    return manager.hear(ratings, now)


def replay(recording: Iterable[Recorded], manager: Manager, period: int) -> Iterator[Entry]:
    """What a manager makes of a recording, by the recording's clock; it hears raters and knows cameras as live.

    Args:
        recording: in order of arrival.
        manager: with a journal of its own.
        period: between rounds, nanoseconds.
    """
    now: int | None = None
    for time_ns, topic, kind, raw in recording:
        if now is not None:  # after so long a silence nobody is waited for, however long it goes on
            for moment in range(now, min(time_ns, now + _QUIET * period), max(1, period // 20)):
                yield from manager.tick(moment)
        now = time_ns
        if (name := owner(topic, RATINGS)) and kind == messages.RATINGS:
            yield from hear_raw(manager, name, raw, time_ns)
        elif camera := owner(topic, IMAGES):
            manager.meet(camera)
    if now is not None:
        yield from manager.tick(now + 2 * period)


class _Office:
    """Publishes what a manager has decided, for programs and for people."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._trust = node.writer(TRUST, messages.TRUST)
        self._diagnostics = node.writer(DIAGNOSTICS, messages.DIAGNOSTICS)
        self._numbers: dict[str, Writer] = {}
        self._diagnosed = 0.0

    @property
    def is_second(self) -> bool:
        """Whether another manager publishes trust, too, and is to go on: of two that begin at once, one does."""
        return self._node.writers_of(TRUST)[:1] != [self._trust.guid]

    def publish(self, entries: list[Entry]) -> None:
        """Publish the trust after some rounds."""
        for entry in entries:
            self._trust.write(messages.trust_message(entry))
            for name, value in zip(entry.team.raters, entry.trust.tor, strict=True):
                self._number(f"/{name}/tor", value)
            for name, value in zip(entry.team.providers, entry.trust.top, strict=True):
                self._number(f"/{name}/top", value)

    def diagnose(self, manager: Manager) -> None:
        """Publish what was refused, and who is waited for, once in a while."""
        if time.monotonic() - self._diagnosed < _DIAGNOSED_S:
            return
        self._diagnosed = time.monotonic()
        refused = {f"{rater or 'unknown'}: {reason}": str(n) for (rater, reason), n in manager.gate.refused.items()}
        unused = {f"{rater}: in no round": str(n) for rater, n in manager.rounds.unused.items()}
        waited = {"waited for": " ".join(manager.rounds.waited_for), "next round": str(manager.next_round)}
        self._diagnostics.write(
            messages.diagnostics_message(time.time_ns(), "manager", bool(refused), {**waited, **refused, **unused})
        )

    def _number(self, topic: str, value: float) -> None:
        if topic not in self._numbers:
            self._numbers[topic] = self._node.writer(topic, messages.NUMBER)
        self._numbers[topic].write(messages.make(messages.NUMBER, data=value))
