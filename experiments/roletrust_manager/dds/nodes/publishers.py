"""Outgoing messages of a node: trust after each round, and the state of the node."""

import time
from collections.abc import Iterable, Mapping

from roletrust_manager.admission import clock
from roletrust_manager.admission.keys import Signer
from roletrust_manager.admission.validation import MANAGER, RefusalReason
from roletrust_manager.dds.manager import Manager
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.dds import Node, TopicWriter
from roletrust_manager.dds.wire.topics import DIAGNOSTICS, TRUST
from roletrust_manager.journal.lines import JournalEntry

INTERVAL_S = 1.0
"""Time between two messages with the state of a node, seconds."""


class DiagnosticsPublisher:
    """Publishes the state of a node for the tools of ROS 2 and the live page.

    Args:
        node: Node that publishes.
        name: Name of the node in the messages, and of its key.
        signer: Private key; None does not sign.
    """

    def __init__(self, node: Node, name: str, signer: Signer | None) -> None:
        self._writer, self._name, self._signer = (
            node.writer(DIAGNOSTICS, messages.DIAGNOSTICS),
            name,
            signer,
        )
        self._last_s = 0.0

    @property
    def is_due(self) -> bool:
        """True if the last message is an interval old."""
        return time.monotonic() - self._last_s >= INTERVAL_S

    def publish(
        self, state: Mapping[str, str], refusals: Mapping[tuple[str, RefusalReason], int]
    ) -> None:
        """Publish the state of the node and its refusals by sender and reason."""
        self._last_s = time.monotonic()
        counts = {
            f"{sender or 'unknown'}: {reason}": str(count)
            for (sender, reason), count in refusals.items()
        }
        values = {**state, **counts}
        self._writer.write(
            messages.diagnostics_message(
                clock.now(), self._name, bool(counts), values, self._signer
            )
        )


class ManagerPublisher:
    """Publishes trust, as one signed message and as numbers, and signed diagnostics.

    Args:
        node: Node of the manager.
        signer: Private key of the manager; None does not sign.
    """

    def __init__(self, node: Node, signer: Signer | None) -> None:
        self._node, self._signer = node, signer
        self._trust = node.writer(TRUST, messages.TRUST)
        self._diagnostics = DiagnosticsPublisher(node, MANAGER, signer)
        self._numbers: dict[str, TopicWriter] = {}

    @property
    def writer(self) -> str:
        """Identifier of the writer of trust."""
        return self._trust.guid

    def publish(self, entries: Iterable[JournalEntry]) -> None:
        """Publish the trust after some rounds."""
        for entry in entries:
            self._trust.write(messages.trust_message(entry, self._signer))
            for name, value in entry.published.tor.items():
                self._publish_number(f"/{name}/tor", value)
            for name, value in entry.published.top.items():
                self._publish_number(f"/{name}/top", value)

    def publish_diagnostics(
        self, manager: Manager, refusals: Mapping[tuple[str, RefusalReason], int]
    ) -> None:
        """Publish the refusals and the expected raters, once per interval."""
        if not self._diagnostics.is_due:
            return
        state = {"writer": self.writer, "waited for": " ".join(manager.rounds.expected)}
        strangers = len(self._node.writers_of(TRUST)) - 1
        if strangers > 0:
            state["other writers of trust"] = str(strangers)
        state["next round"] = str(manager.next_round)
        state |= {f"{rater}: in no round": str(n) for rater, n in manager.rounds.unused.items()}
        self._diagnostics.publish(state, refusals)

    def _publish_number(self, topic: str, value: float) -> None:
        if topic not in self._numbers:
            self._numbers[topic] = self._node.writer(topic, messages.NUMBER)
        self._numbers[topic].write(messages.make(messages.NUMBER, data=value))
