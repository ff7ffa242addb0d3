"""The trust manager as a process: receives the ratings of every rater, and publishes trust."""

import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from roletrust_env.trust import TrustModel
from roletrust_manager.admission import clock
from roletrust_manager.admission.keys import PublicKeys, Signer
from roletrust_manager.admission.validation import MANAGER, Admission, Keyring
from roletrust_manager.dds.manager import Manager
from roletrust_manager.dds.nodes.inboxes import diagnostics_inbox, rating_inbox, read_message
from roletrust_manager.dds.nodes.publishers import INTERVAL_S, ManagerPublisher
from roletrust_manager.dds.nodes.run_loop import SECOND, print_line, run_until_signal
from roletrust_manager.dds.rounds import RoundTiming
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.dds import Node, Publication
from roletrust_manager.dds.wire.topics import IMAGES, RATINGS, TRUST, owner
from roletrust_manager.journal.lines import JournalEntry
from roletrust_manager.team import Team

if TYPE_CHECKING:  # a manager needs no recordings
    from roletrust_manager.dds.wire.recording import RecordedMessage

DISCOVERY_S = 1.0
"""Time within which nodes of one machine find each other, seconds."""

_DEPTH = 200  # messages of a rater that are stored while the manager is busy
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
    report: Callable[[str], object] = print_line,
) -> None:
    """Run the manager until a signal ends the process.

    Args:
        model: Trust model.
        journal: Path of the journal; an existing one is continued.
        period: Time between rounds, nanoseconds.
        team: Agents that are expected from the start.
        keys: Folder with the public keys of the team and the manager's private key; None accepts
            ratings in any name and does not sign.
        network: See `Node`.
        report: Function that shows a line to the user.

    Raises:
        ValueError: Another manager is active, or the journal does not fit, see `Manager`.
    """
    keyring, signer = (
        (None, None) if keys is None else (PublicKeys(keys, [MANAGER]), Signer(keys, MANAGER))
    )
    node, timing = Node("manager", network=network), RoundTiming(period)
    precedence = Precedence(node, keyring)
    if precedence.wait_for_others():
        raise ValueError(_SECOND_MANAGER)
    manager = Manager(model, journal, timing=timing, team=team, keyring=keyring, report=report)
    if keyring is None:
        report(
            "manager: WITHOUT KEYS: everybody on this network can rate in any name, and forge trust"
        )
    publisher = ManagerPublisher(node, signer)
    precedence.own = publisher.writer
    known, strangers = manager.known_raters, keyring is None
    raters = rating_inbox(node, timing, manager.admission, known, strangers=strangers, depth=_DEPTH)
    begins = f"continues with round {manager.next_round} of" if manager.next_round else "begins"
    report(f"manager: {begins} {journal}, and waits for ratings")
    with run_until_signal() as active:
        while active:
            publications = node.discover()
            raters.update(publications)
            for publication in publications:
                if camera := owner(publication.topic, IMAGES):
                    manager.add_provider(camera, clock.now())
            if precedence.is_second(publications):
                raise ValueError(_SECOND_MANAGER)
            for message in raters.read():
                now = clock.now()
                publisher.publish(
                    manager.receive(message, now, raters.arrival(message.envelope, now))
                )
            publisher.publish(manager.tick(clock.now()))
            publisher.publish_diagnostics(manager, raters.refusals + precedence.admission.refusals)
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
    message = read_message(raw, name, messages.read_ratings_message, manager.admission)
    return [] if message is None else manager.receive(message, now)


def replay_recording(
    recording: "Iterable[RecordedMessage]", manager: Manager, period: int
) -> Iterator[JournalEntry]:
    """Iterate over the rounds that a manager makes of a recording, by the clock of the recording.

    Args:
        recording: Messages in order of arrival.
        manager: Manager with a journal of its own.
        period: Time between rounds, nanoseconds.
    """
    now: int | None = None
    for time_ns, topic, kind, raw in recording:
        if (
            now is not None
        ):  # after a long silence no round is open, so the rest of the silence is skipped
            for moment in range(
                now, min(time_ns, now + _QUIET_PERIODS * period), max(1, period // 20)
            ):
                yield from manager.tick(moment)
        now = time_ns
        if (name := owner(topic, RATINGS)) and kind == messages.RATINGS:
            yield from receive_raw(manager, name, raw, time_ns)
        elif camera := owner(topic, IMAGES):
            manager.add_provider(camera, time_ns)
    if now is not None:
        yield from manager.tick(now + 2 * period)


class Precedence:
    """Decides whether this manager may publish trust when others do: at most one manager of a team
    does.

    With keys, only a holder of the manager's key counts: its signed diagnostics name its writer of
    trust. Messages from before the start of this manager do not count, so the messages of a killed
    manager cannot be sent again to stop this one. Without keys, every writer of trust counts. If
    two managers start at the same time, exactly one of them has precedence.

    Args:
        node: Node of this manager.
        keyring: Keys of the team; None if there are none.

    Attributes:
        own: Writer of trust of this manager; empty until it has one.
    """

    def __init__(self, node: Node, keyring: Keyring | None) -> None:
        self._node, self._signed, self._began, self.own = node, keyring is not None, clock.now(), ""
        # other nodes publish diagnostics of their own
        self._inbox = diagnostics_inbox(
            node, keyring, lambda name: self._signed and name == MANAGER
        )
        self._others = set[str]()

    @property
    def admission(self) -> Admission:
        """Counts forged diagnostics."""
        return self._inbox.admission

    def wait_for_others(self) -> bool:
        """Wait until other managers would be known, and return whether there is one."""
        time.sleep(DISCOVERY_S)
        if not self._node.writers_of(TRUST):
            return False
        if not self._signed:
            return True
        end = time.monotonic() + 2 * INTERVAL_S
        while not self._others and time.monotonic() < end:
            self._node.wait(end - time.monotonic())
            self._read()
        return bool(self._others)

    def is_second(self, publications: Iterable[Publication]) -> bool:
        """Return whether another manager publishes trust as well and has precedence."""
        self._read()
        if not self._signed and any(publication.topic == TRUST for publication in publications):
            self._others = {*self._node.writers_of(TRUST)} - {self.own}
        return any(other < self.own for other in self._others)

    def _read(self) -> None:
        """Read the diagnostics of other managers."""
        for message in self._inbox.take(clock.now()):
            if message.envelope.stamp >= self._began:
                self._others |= {message.values.get("writer", "")} - {self.own}
