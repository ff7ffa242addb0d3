"""The trust manager as a process: receives the ratings of every rater, and publishes trust."""

import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from roletrust_env.live.journal import JournalEntry
from roletrust_env.live.manager import Manager
from roletrust_env.live.message_validation import MANAGER, RefusalReason
from roletrust_env.live.nodes.agent_readers import AgentReaders
from roletrust_env.live.nodes.manager_publisher import ManagerPublisher
from roletrust_env.live.nodes.precedence import Precedence
from roletrust_env.live.nodes.run_loop import SECOND, run_until_signal
from roletrust_env.live.nodes.topics import IMAGES, RATINGS, TRUST, owner
from roletrust_env.live.rounds import RoundTiming
from roletrust_env.live.trust_tracker import Team
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Quota, Reader
from roletrust_env.live.wire.keys import PublicKeys, Signer
from roletrust_env.live.wire.recording import RecordedMessage
from roletrust_env.trust import TrustModel

_DEPTH = 200  # messages of a rater that are stored while the manager is busy
_MAX_PER_PERIOD = 10  # messages that a rater may send in a period; it needs one
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
        keys: Folder with the public keys of the team and the manager's private key; None accepts ratings in any name
            and does not sign.
        network: See `Node`.
        report: Function that shows a line to the user.

    Raises:
        ValueError: Another manager is active, or the journal does not fit, see `Manager`.
    """
    keyring, signer = (None, None) if keys is None else (PublicKeys(keys, [MANAGER]), Signer(keys, MANAGER))
    node = Node("manager", network=network)
    precedence = Precedence(node, keyring)
    if precedence.wait_for_others():
        raise ValueError(_SECOND_MANAGER)
    manager = Manager(model, journal, timing=RoundTiming(period), team=team, keyring=keyring)
    if keyring is None:
        report("manager: WITHOUT KEYS: everybody on this network can rate in any name, and forge trust")
    if manager.next_round:
        report(f"manager: continues with round {manager.next_round} of {journal}")
    publisher = ManagerPublisher(node, signer)
    quota = math.ceil(_MAX_PER_PERIOD * SECOND / period)

    def reader(topic: str, kind: str) -> Reader:
        return node.reader(topic, kind, depth=_DEPTH, quota=Quota(quota))

    raters = AgentReaders(node, RATINGS, messages.RATINGS, manager.known_raters, strangers=keyring is None, make=reader)
    with run_until_signal() as active:
        while active:
            publications = node.discover()
            raters.update(publications)
            for publication in publications:
                if camera := owner(publication.topic, IMAGES):
                    manager.add_provider(camera, time.time_ns())
            precedence.update(publisher.writer, publications)
            if precedence.is_second(publisher.writer):
                raise ValueError(_SECOND_MANAGER)
            for name, rater in raters:
                for raw in rater.take():
                    publisher.publish(receive_raw(manager, name, raw, time.time_ns()))
                if rater.over_quota:
                    manager.validator.refuse(name, RefusalReason.FLOOD, rater.over_quota)
                    rater.over_quota = 0
            publisher.publish(manager.tick(time.time_ns()))
            crowd = {(f"participant {one}", RefusalReason.CROWDED): n for one, n in raters.turned_away.items()}
            publisher.publish_diagnostics(manager, precedence.validator.refusals + Counter(crowd))
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
            manager.add_provider(camera, time_ns)
    if now is not None:
        yield from manager.tick(now + 2 * period)
