"""The trust manager as a process: receives the ratings of every rater, and publishes trust."""

import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from roletrust_env.live.journal import JournalEntry
from roletrust_env.live.manager import Manager
from roletrust_env.live.nodes.run_loop import SECOND, run_until_signal
from roletrust_env.live.nodes.topics import DIAGNOSTICS, IMAGES, RATINGS, TRUST, owner
from roletrust_env.live.rating_validation import RefusalReason
from roletrust_env.live.rounds import RoundTiming
from roletrust_env.live.trust_tracker import Team
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Quota, Reader, Writer
from roletrust_env.live.wire.keys import PublicKeys
from roletrust_env.live.wire.recording import RecordedMessage
from roletrust_env.trust import TrustModel

_DEPTH = 200  # messages of a rater that are stored while the manager is busy
_MAX_PER_PERIOD = 10  # messages that a rater may send in a period; it needs one
_DISCOVERY_S = 1.0  # nodes of one machine find each other within that time
_DIAGNOSTICS_S = 1.0
_QUIET_PERIODS = 10  # after that many periods without a message, no round is open
_SECOND_MANAGER = f"another manager publishes {TRUST}; stop it first, or set another ROS_DOMAIN_ID"


def run_manager_node(
    model: TrustModel[Any],
    journal: Path,
    *,
    period: int,
    team: Team | None = None,
    keys: Path | None = None,
    network: bool = False,
    report: Callable[[str], None] = lambda line: print(line, file=sys.stderr, flush=True),
) -> None:
    """Run the manager until a signal ends the process.

    Args:
        model: Trust model.
        journal: Path of the journal; an existing one is continued.
        period: Time between rounds, nanoseconds.
        team: Agents that are expected from the start.
        keys: Folder with the raters' public keys; None accepts ratings in any name.
        network: See `Node`.
        report: Function that shows a line to the user.

    Raises:
        ValueError: Another manager is active, or the journal does not fit, see `Manager`.
    """
    keyring = None if keys is None else PublicKeys(keys)
    node = Node("manager", network=network)
    time.sleep(_DISCOVERY_S)
    publications = node.discover()
    if any(other.topic == TRUST for other in publications):
        raise ValueError(_SECOND_MANAGER)
    manager = Manager(model, journal, timing=RoundTiming(period), team=team, keyring=keyring)
    if keyring is None:
        report("manager: WITHOUT KEYS: everybody on this network can rate in any name")
    if manager.next_round:
        report(f"manager: continues with round {manager.next_round} of {journal}")
    publisher, raters = _ManagerPublisher(node), dict[str, Reader]()
    quota = math.ceil(_MAX_PER_PERIOD * SECOND / period)
    with run_until_signal() as active:
        while active:
            for topic, kind in (*publications, *node.discover()):
                if (name := owner(topic, RATINGS)) and kind == messages.RATINGS and name not in raters:
                    raters[name] = node.reader(topic, messages.RATINGS, depth=_DEPTH, quota=Quota(quota))
                elif topic == TRUST and publisher.is_second:
                    raise ValueError(_SECOND_MANAGER)
                elif camera := owner(topic, IMAGES):
                    manager.add_provider(camera)
            publications = []
            for name, reader in raters.items():
                for raw in reader.take():
                    publisher.publish(receive_raw(manager, name, raw, time.time_ns()))
                if reader.over_quota:
                    manager.validator.refuse(name, RefusalReason.FLOOD, reader.over_quota)
                    reader.over_quota = 0
            publisher.publish(manager.tick(time.time_ns()))
            publisher.publish_diagnostics(manager)
            node.wait(period / SECOND / 20)
    manager.close()


def receive_raw(manager: Manager, name: str, raw: bytes, now: int) -> list[JournalEntry]:
    """Pass a message on a rater's topic to a manager and return the rounds that it closes.

    Args:
        manager: Manager.
        name: Name of the rater whose topic it is.
        raw: Message, as CDR.
        now: Time of arrival, nanoseconds.
    """
    try:
        ratings = messages.read_ratings(raw)
    except ValueError:
        manager.validator.refuse(name, RefusalReason.GARBAGE)
        return []
    if ratings.rater != name:
        manager.validator.refuse(name, RefusalReason.ELSEWHERE)
        return []
    return manager.receive(ratings, now)


def replay_recording(recording: Iterable[RecordedMessage], manager: Manager, period: int) -> Iterator[JournalEntry]:
    """Iterate over the rounds that a manager makes of a recording, by the clock of the recording.

    Args:
        recording: Messages in order of arrival.
        manager: Manager with a journal of its own.
        period: Time between rounds, nanoseconds.
    """
    now: int | None = None
    for time_ns, topic, kind, raw in recording:
        if now is not None:  # after a long silence no round is open, so the rest of the silence is skipped
            for moment in range(now, min(time_ns, now + _QUIET_PERIODS * period), max(1, period // 20)):
                yield from manager.tick(moment)
        now = time_ns
        if (name := owner(topic, RATINGS)) and kind == messages.RATINGS:
            yield from receive_raw(manager, name, raw, time_ns)
        elif camera := owner(topic, IMAGES):
            manager.add_provider(camera)
    if now is not None:
        yield from manager.tick(now + 2 * period)


class _ManagerPublisher:
    """Publishes the manager's trust and its diagnostics."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._trust = node.writer(TRUST, messages.TRUST)
        self._diagnostics = node.writer(DIAGNOSTICS, messages.DIAGNOSTICS)
        self._numbers: dict[str, Writer] = {}
        self._last_diagnostics_s = 0.0

    @property
    def is_second(self) -> bool:
        """True if another manager publishes trust as well and has precedence.

        If two managers start at the same time, exactly one of them has precedence.
        """
        return self._node.writers_of(TRUST)[:1] != [self._trust.guid]

    def publish(self, entries: list[JournalEntry]) -> None:
        """Publish the trust after some rounds."""
        for entry in entries:
            self._trust.write(messages.trust_message(entry))
            for name, value in zip(entry.team.raters, entry.trust.tor, strict=True):
                self._publish_number(f"/{name}/tor", value)
            for name, value in zip(entry.team.providers, entry.trust.top, strict=True):
                self._publish_number(f"/{name}/top", value)

    def publish_diagnostics(self, manager: Manager) -> None:
        """Publish the refusals and the expected raters, once per interval."""
        if time.monotonic() - self._last_diagnostics_s < _DIAGNOSTICS_S:
            return
        self._last_diagnostics_s = time.monotonic()
        refusals = {
            f"{rater or 'unknown'}: {reason}": str(n) for (rater, reason), n in manager.validator.refusals.items()
        }
        unused = {f"{rater}: in no round": str(n) for rater, n in manager.rounds.unused.items()}
        state = {"waited for": " ".join(manager.rounds.expected), "next round": str(manager.next_round)}
        self._diagnostics.write(
            messages.diagnostics_message(time.time_ns(), "manager", bool(refusals), {**state, **refusals, **unused})
        )

    def _publish_number(self, topic: str, value: float) -> None:
        if topic not in self._numbers:
            self._numbers[topic] = self._node.writer(topic, messages.NUMBER)
        self._numbers[topic].write(messages.make(messages.NUMBER, data=value))
