"""Readers of topics that come and go: those of known agents always, those of strangers up to a limit."""

import time
from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator

from roletrust_env.live.admission import MAX_STRANGERS
from roletrust_env.live.nodes.topics import owner
from roletrust_env.live.wire.dds import Node, Publication, Reader

_GONE_S = 5.0  # a topic without a writer for that long has no reader
_LOOK_S = 1.0
_COUNTED = 20  # participants that are counted by their identifier

Make = Callable[[str, str], Reader]
"""A function `(topic, kind)` that makes a reader."""


class TopicReaders:
    """Readers of topics. A topic has a reader while it has writers; it is dropped some seconds after the last has gone.

    Args:
        node: Node that subscribes.
        make: Function that makes a reader.
    """

    def __init__(self, node: Node, make: Make) -> None:
        self._node, self._make = node, make
        self._readers: dict[str, Reader] = {}
        self._last_written: dict[str, float] = {}
        self._looked = 0.0

    def __contains__(self, topic: object) -> bool:
        """Return whether a topic is read."""
        return topic in self._readers

    def items(self) -> Iterable[tuple[str, Reader]]:
        """Return the topics and their readers."""
        return self._readers.items()

    def add(self, topic: str, kind: str) -> None:
        """Read a topic from now on."""
        self._readers[topic], self._last_written[topic] = self._make(topic, kind), time.monotonic()

    def drop_silent(self) -> bool:
        """Drop the readers whose writers have gone, and return whether there were any. Call it often."""
        now = time.monotonic()
        if now - self._looked < _LOOK_S:
            return False
        self._looked, gone = now, []
        for topic, reader in self._readers.items():
            if reader.writers:
                self._last_written[topic] = now
            elif now - self._last_written[topic] > _GONE_S:
                gone.append(topic)
        for topic in gone:
            self._node.drop(self._readers.pop(topic))
            del self._last_written[topic]
        return bool(gone)


class AgentReaders:
    """Readers of one kind of topic of all agents, such as the pictures of all cameras.

    Topics of agents that are not known have readers only while fewer than `MAX_STRANGERS` of them have.

    Args:
        node: Node that subscribes.
        ending: Ending of the topics behind the names of the agents.
        kind: Type of the messages.
        known: Agents that are always read.
        strangers: Whether other agents are read at all.
        make: Function that makes a reader; None for that of the node.

    Attributes:
        turned_away: Number of topics that were not read, by the participant that publishes them.
    """

    def __init__(
        self, node: Node, ending: str, kind: str, known: Container[str], *, strangers: bool, make: Make | None = None
    ) -> None:
        self._node, self._ending, self._kind, self._known, self._strangers = node, ending, kind, known, strangers
        self._readers = TopicReaders(node, make or node.reader)
        self.turned_away: Counter[str] = Counter()

    def __iter__(self) -> Iterator[tuple[str, Reader]]:
        """Iterate over the names of the agents and their readers; known agents come first."""
        named = [(owner(topic, self._ending) or "", reader) for topic, reader in self._readers.items()]
        return iter(sorted(named, key=lambda entry: entry[0] not in self._known))

    def update(self, publications: Iterable[Publication]) -> None:
        """Read the topics of new publications, and drop those whose writers have gone."""
        for one in publications:
            name = owner(one.topic, self._ending)
            if name is not None and one.kind == self._kind and one.topic not in self._readers:
                if name in self._known or self._has_place():
                    self._readers.add(one.topic, one.kind)
                else:
                    self._turn_away(one.participant)
        if self._readers.drop_silent():  # some have a place now, and a slow writer may not have been connected yet
            self.update(self._node.publications())

    def _has_place(self) -> bool:
        """Return whether one more stranger can be read."""
        return self._strangers and sum(name not in self._known for name, _ in self) < MAX_STRANGERS

    def _turn_away(self, participant: str) -> None:
        """Count a topic that is not read."""
        named = participant in self.turned_away or len(self.turned_away) < _COUNTED
        self.turned_away[participant if named else "others"] += 1
