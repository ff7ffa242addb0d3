"""A node without middleware, whose readers get the messages that a test puts on a topic."""

from collections import defaultdict
from types import SimpleNamespace

from roletrust_manager.dds.wire.dds import Publication


class FixedSigner:
    """Signs everything with the same bytes."""

    def __init__(self, signature):
        self.signature = signature

    def sign(self, data):
        return self.signature


class FakeReader:
    """Receives the messages of one topic.

    Attributes:
        writers: Number of writers.
        excess: Number of discarded messages.
    """

    def __init__(self, waiting):
        self._waiting, self.writers, self.excess = waiting, 1, 0

    def take(self):
        taken = self._waiting[:]
        self._waiting.clear()
        return taken


class FakeWire:
    """A node.

    Attributes:
        waiting: Messages of each topic.
        readers: Readers by topic.
        dropped: Topics of dropped readers.
        announced: New publications.
        sent: Messages that the node has published.
    """

    def __init__(self):
        self.waiting, self.readers, self.dropped, self.announced = defaultdict(list), {}, [], []
        self.sent = []

    def reader(self, topic, kind, **_):
        self.readers[topic] = FakeReader(self.waiting[topic])
        return self.readers[topic]

    def writer(self, topic, kind):
        return SimpleNamespace(write=self.sent.append)

    def drop(self, reader):
        topic = next(topic for topic, one in self.readers.items() if one is reader)
        self.dropped.append(topic)
        del self.readers[topic]

    def announce(self, ending, kind, *names, participant="one"):
        publications = [Publication(f"/{name}{ending}", kind, participant) for name in names]
        self.announced += publications
        return publications

    def discover(self):
        new, self.announced = self.announced, []
        return new

    def publications(self):
        return self.discover()

    def wait(self, seconds):
        pass
