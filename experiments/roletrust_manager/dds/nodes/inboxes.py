"""Incoming messages of a node: one topic, or one kind of topic of all agents, whose topics come and
go.
"""

import time
from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator
from functools import partial
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from roletrust_manager.admission import clock
from roletrust_manager.admission.validation import (
    MANAGER,
    MAX_STRANGERS,
    Admission,
    Envelope,
    Keyring,
    RatingMessage,
    RefusalReason,
    StampLimits,
    keys_by_role,
)
from roletrust_manager.dds.rounds import RoundTiming
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.dds import Node, Publication, Quota, Reader
from roletrust_manager.dds.wire.topics import DIAGNOSTICS, IMAGES, RATINGS, TRUST, owner
from roletrust_manager.team import PublishedTrust, Team

LIMITS = StampLimits(tolerance=10_000_000_000, min_gap=1)
"""Limits on the stamps of diagnostics, and of the trust of short rounds.

A message that is sent again within the tolerance has an old stamp.
"""

_MAX_PER_SECOND = 100  # messages of a node on a topic of all, such as `/diagnostics`
_GONE_S = 5.0  # a topic without a writer for that long has no reader
_CHECK_S = 1.0
_LONGEST_PAUSE = (
    30_000_000_000  # of this process, nanoseconds: what has waited longer counts as late
)
_COUNTED = 20  # participants that are counted by their identifier


class _Message(Protocol):
    @property
    def envelope(self) -> Envelope: ...


M = TypeVar("M", bound=_Message)


def read_message(
    raw: bytes, sender: str, read: Callable[[bytes], M | None], admission: Admission
) -> M | None:
    """Read a message on the topic of a sender.

    Args:
        raw: Message, as CDR.
        sender: Name of the sender; empty for a topic of all.
        read: Function that reads it, or returns None if it is not for this node.
        admission: Counts the message if it is refused.

    Returns:
        The message; None if it cannot be read, names another sender or is not for this node.
    """
    try:
        message = read(raw)
    except ValueError:
        admission.refuse(sender, RefusalReason.GARBAGE)
        return None
    if message is not None and sender and message.envelope.sender != sender:
        admission.refuse(sender, RefusalReason.ELSEWHERE)
        return None
    return message


def _read_all(
    reader: Reader, sender: str, read: Callable[[bytes], M | None], admission: Admission
) -> Iterator[M]:
    """Iterate over the new messages of a reader that can be read; a flood is counted."""
    for raw in reader.take():
        if (message := read_message(raw, sender, read, admission)) is not None:
            yield message
    if reader.excess:
        admission.refuse(sender, RefusalReason.FLOOD, reader.excess)
        reader.excess = 0


class Inbox(Generic[M]):
    """Receives the valid messages of one topic.

    Args:
        reader: Reader of the topic.
        read: See `read_message`.
        admission: Refuses invalid messages and counts them.
        sender: Name of the sender; empty for a topic of all.

    Attributes:
        admission: Refuses invalid messages and counts them.
    """

    def __init__(
        self,
        reader: Reader,
        read: Callable[[bytes], M | None],
        admission: Admission,
        sender: str = "",
    ) -> None:
        self._reader, self._read, self._sender, self.admission = reader, read, sender, admission

    def take(self, now: int) -> Iterator[M]:
        """Iterate over the valid messages since the last call.

        Args:
            now: Time, nanoseconds.
        """
        for message in _read_all(self._reader, self._sender, self._read, self.admission):
            if self.admission.accepts(message.envelope, now):
                yield message


def trust_limits(timing: RoundTiming) -> StampLimits:
    """Return the limits on the stamps of trust: those of its rounds, which may have been old when
    they closed.
    """
    return StampLimits(max(LIMITS.tolerance, 2 * timing.tolerance), LIMITS.min_gap)


def trust_inbox(
    node: Node, keyring: Keyring | None, limits: StampLimits = LIMITS
) -> Inbox[messages.TrustMessage]:
    """Return an inbox of the published trust. With keys, it counts only if the manager has signed
    it.

    Args:
        node: Node that subscribes.
        keyring: Keys of the team, with the manager's; None accepts every message.
        limits: See `trust_limits`.
    """
    reader = node.reader(TRUST, messages.TRUST, depth=100, quota=Quota(_MAX_PER_SECOND))
    return Inbox(reader, messages.read_trust_message, Admission(limits, keyring), MANAGER)


def diagnostics_inbox(
    node: Node, keyring: Keyring | None, counts: Callable[[str], bool]
) -> Inbox[messages.DiagnosticsMessage]:
    """Return an inbox of the state of nodes. With keys, it counts only if the node has signed it.

    Args:
        node: Node that subscribes.
        keyring: Keys of the team, with the manager's; None accepts every message.
        counts: Function that says whether a node of that name is of interest.
    """

    def read(raw: bytes) -> messages.DiagnosticsMessage | None:
        message = messages.read_diagnostics_message(raw)
        return message if message is not None and counts(message.envelope.sender) else None

    reader = node.reader(DIAGNOSTICS, messages.DIAGNOSTICS, depth=100, quota=Quota(_MAX_PER_SECOND))
    return Inbox(reader, read, Admission(LIMITS, keyring))


class TrustSubscription:
    """The most recently published trust.

    Args:
        node: Node that subscribes.
        initial: Trust of agents about which nothing has been published.
        keyring: See `trust_inbox`.
        limits: See `trust_limits`.

    Attributes:
        inbox: Incoming messages.
    """

    def __init__(
        self,
        node: Node,
        initial: float,
        keyring: Keyring | None = None,
        limits: StampLimits = LIMITS,
    ) -> None:
        self.inbox, self._initial = trust_inbox(node, keyring, limits), initial
        self._trust = PublishedTrust(0, 0, {}, {}, ())

    def update(self) -> None:
        """Read the new messages."""
        for message in self.inbox.take(clock.now()):
            self._trust = message.trust

    def tor(self, rater: str) -> float:
        """Return the trust of a rater."""
        return self._trust.tor.get(rater, self._initial)

    def top(self, provider: str) -> float:
        """Return the trust of a provider."""
        return self._trust.top.get(provider, self._initial)


class RatingSubscription:
    """The ratings of one provider. Everybody on the network can read them.

    Args:
        node: Node that subscribes.
        provider: Rated provider.
        raters: Raters to listen to.
        timing: Timing of the rounds, which limits the stamps.
        keyring: Raters that may rate; None accepts every rater.
    """

    def __init__(
        self,
        node: Node,
        provider: str,
        raters: tuple[str, ...],
        timing: RoundTiming,
        keyring: Keyring | None = None,
    ) -> None:
        self._provider, admission = provider, Admission(timing.limits, keyring)
        self._inboxes = [
            Inbox(
                node.reader(f"/{rater}{RATINGS}", messages.RATINGS),
                messages.read_ratings_message,
                admission,
                rater,
            )
            for rater in raters
        ]

    def take(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the newest rating of each rater since the last call, and a mask of where there is
        one, (S,) each.

        The rating is 0 where there is none.
        """
        ratings, rated = np.zeros(len(self._inboxes)), np.zeros(len(self._inboxes), bool)
        for i, inbox in enumerate(self._inboxes):
            for message in inbox.take(clock.now()):
                rating = dict(zip(message.providers, message.values, strict=True)).get(
                    self._provider
                )
                if rating is not None:
                    rated[i] = 0 <= rating <= 1
                    ratings[i] = rating if rated[i] else 0.0
        return ratings, rated


class TopicReaders:
    """Readers of topics. A topic has a reader while it has writers; it is dropped some seconds
    after the last has gone.

    Args:
        node: Node that subscribes.
        depth: See `Node.reader`.
        quota: Number of messages that a writer may send in a second; None for no limit.
    """

    def __init__(self, node: Node, depth: int, quota: int | None = None) -> None:
        self._node, self._depth, self._quota = node, depth, quota
        self._readers: dict[str, Reader] = {}
        self._last_written: dict[str, float] = {}
        self._checked = 0.0

    def __contains__(self, topic: object) -> bool:
        """Return whether a topic is read."""
        return topic in self._readers

    def items(self) -> Iterable[tuple[str, Reader]]:
        """Return the topics and their readers."""
        return self._readers.items()

    def add(self, topic: str, kind: str) -> None:
        """Read a topic from now on."""
        quota = None if self._quota is None else Quota(self._quota)
        self._readers[topic] = self._node.reader(topic, kind, depth=self._depth, quota=quota)
        self._last_written[topic] = time.monotonic()

    def drop_silent(self) -> bool:
        """Drop the readers whose writers have gone, and return whether there were any. Call it
        often.
        """
        now = time.monotonic()
        if now - self._checked < _CHECK_S:
            return False
        self._checked, gone = now, []
        for topic, reader in self._readers.items():
            if reader.writers:
                self._last_written[topic] = now
            elif now - self._last_written[topic] > _GONE_S:
                gone.append(topic)
        for topic in gone:
            self._node.drop(self._readers.pop(topic))
            del self._last_written[topic]
        return bool(gone)


class AgentInbox(Generic[M]):
    """Receives the messages on one kind of topic of all agents, such as the pictures of all
    cameras.

    Known agents are always received, others up to `MAX_STRANGERS`, or not at all.

    Args:
        node: Node that subscribes.
        ending: Ending of the topics behind the names of the agents.
        kind: Type of the messages.
        read: Function of the name of an agent and a message on its topic, as CDR, that reads the
            message.
        admission: Refuses invalid messages and counts them.
        known: Agents that are always received.
        strangers: Whether other agents are received.
        timing: Timing of the rounds, which limits the messages of each sender.
        depth: See `Node.reader`.

    Attributes:
        known: Agents that are always received.
        admission: Refuses invalid messages and counts them.
        turned_away: Number of topics that were not read, by the participant that publishes them.
    """

    def __init__(
        self,
        node: Node,
        ending: str,
        kind: str,
        read: Callable[[str, bytes], M],
        admission: Admission,
        known: Container[str],
        *,
        strangers: bool,
        timing: RoundTiming,
        depth: int = 10,
    ) -> None:
        self._node, self._ending, self._kind, self._read, self._period = (
            node,
            ending,
            kind,
            read,
            timing.period,
        )
        self._since = self._began = clock.now()  # of the last two reads
        self.admission, self.known, self._strangers = admission, known, strangers
        self._readers = TopicReaders(node, depth, timing.quota)
        self.turned_away: Counter[str] = Counter()

    def update(self, publications: Iterable[Publication]) -> None:
        """Read the topics of new publications, and drop those whose writers have gone."""
        for publication in publications:
            topic, name = publication.topic, owner(publication.topic, self._ending)
            if name is not None and publication.kind == self._kind and topic not in self._readers:
                if name in self.known or self._has_place():
                    self._readers.add(topic, publication.kind)
                else:
                    self._turn_away(publication.participant)
        if (
            self._readers.drop_silent()
        ):  # others have a place now, and a slow writer may not have been connected yet
            self.update(self._node.publications())

    def read(self) -> Iterator[M]:
        """Iterate over the messages since the last call that can be read, valid or not; known
        agents come first.
        """
        self._since, self._began = self._began, clock.now()
        for name, reader in self.readers():
            yield from _read_all(reader, name, partial(self._read, name), self.admission)

    def take(self, now: int) -> Iterator[M]:
        """Iterate over the valid messages since the last call; known agents come first.

        Args:
            now: Time, nanoseconds.
        """
        for message in self.read():
            if self.admission.accepts(message.envelope, self.arrival(message.envelope, now)):
                yield message

    def arrival(self, envelope: Envelope, now: int) -> int:
        """Return the time of arrival of a message that was just read.

        After a pause of this process, messages have waited. Each of them then counts as prompt, as
        far as it can have arrived in the pause.

        Args:
            envelope: Origin of the message.
            now: Time, nanoseconds.
        """
        since = max(self._since, now - _LONGEST_PAUSE)
        return now if now - since <= self._period else max(since, min(envelope.stamp, now))

    @property
    def refusals(self) -> Counter[tuple[str, RefusalReason]]:
        """Refusals by sender and reason; those of topics that are not read, by their
        participant.
        """
        reason = RefusalReason.CROWDED if self._strangers else RefusalReason.UNKNOWN
        away = {
            (f"participant {participant}", reason): count
            for participant, count in self.turned_away.items()
        }
        return self.admission.refusals + Counter(away)

    def readers(self) -> list[tuple[str, Reader]]:
        """Return the names of the agents and their readers; known agents come first."""
        named = [
            (owner(topic, self._ending) or "", reader) for topic, reader in self._readers.items()
        ]
        return sorted(named, key=lambda entry: entry[0] not in self.known)

    def _has_place(self) -> bool:
        """Return whether one more stranger can be read."""
        return (
            self._strangers
            and sum(name not in self.known for name, _ in self.readers()) < MAX_STRANGERS
        )

    def _turn_away(self, participant: str) -> None:
        """Count a topic that is not read."""
        named = participant in self.turned_away or len(self.turned_away) < _COUNTED
        self.turned_away[participant if named else "others"] += 1


def camera_inbox(
    node: Node, timing: RoundTiming, keyring: Keyring | None, team: Team
) -> AgentInbox[messages.PictureMessage]:
    """Return an inbox of the pictures of all cameras.

    With keys, a picture counts only if its camera has signed it, which is checked before it is
    decoded. Without keys, cameras that the team does not name are limited in number.

    Args:
        node: Node that subscribes.
        timing: Timing of the rounds, which limits the stamps as it does for ratings.
        keyring: Keys of the team; None accepts every camera.
        team: Agents of the scenario.
    """
    _, serving = keys_by_role(keyring, team)
    known = team.providers if serving is None else serving
    admission = Admission(timing.limits, serving, members=team.providers)
    return AgentInbox(
        node,
        IMAGES,
        messages.IMAGE,
        messages.read_picture_message,
        admission,
        known,
        strangers=serving is None,
        timing=timing,
    )


def rating_inbox(
    node: Node,
    timing: RoundTiming,
    admission: Admission,
    known: Container[str],
    *,
    strangers: bool,
    depth: int = 10,
) -> AgentInbox[RatingMessage]:
    """Return an inbox of the ratings of all raters; for the arguments, see `AgentInbox`."""

    def read(rater: str, raw: bytes) -> RatingMessage:
        return messages.read_ratings_message(raw)

    return AgentInbox(
        node,
        RATINGS,
        messages.RATINGS,
        read,
        admission,
        known,
        strangers=strangers,
        timing=timing,
        depth=depth,
    )
