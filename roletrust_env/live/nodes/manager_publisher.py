"""What the manager publishes: trust after each round, and its state."""

from collections import Counter

from roletrust_env.live.journal import JournalEntry
from roletrust_env.live.manager import Manager
from roletrust_env.live.message_validation import MANAGER, RefusalReason
from roletrust_env.live.nodes.diagnostics import DiagnosticsPublisher
from roletrust_env.live.nodes.signatures import sign
from roletrust_env.live.nodes.topics import TRUST
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Writer
from roletrust_env.live.wire.keys import Signer


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
        self._numbers: dict[str, Writer] = {}

    @property
    def writer(self) -> str:
        """Identifier of the writer of trust."""
        return self._trust.guid

    def publish(self, entries: list[JournalEntry]) -> None:
        """Publish the trust after some rounds."""
        for entry in entries:
            self._trust.write(sign(messages.trust_message(entry), self._signer))
            for name, value in zip(entry.team.raters, entry.trust.tor, strict=True):
                self._publish_number(f"/{name}/tor", value)
            for name, value in zip(entry.team.providers, entry.trust.top, strict=True):
                self._publish_number(f"/{name}/top", value)

    def publish_diagnostics(self, manager: Manager, further: Counter[tuple[str, RefusalReason]]) -> None:
        """Publish the refusals and the expected raters, once per interval.

        Args:
            manager: Manager.
            further: Refusals of messages that did not reach the manager.
        """
        if not self._diagnostics.is_due:
            return
        unused = {f"{rater}: in no round": str(n) for rater, n in manager.rounds.unused.items()}
        state = {"writer": self.writer, "waited for": " ".join(manager.rounds.expected)}
        strangers = len(self._node.writers_of(TRUST)) - 1
        if strangers > 0:
            state["other writers of trust"] = str(strangers)
        state = {**state, "next round": str(manager.next_round), **unused}
        self._diagnostics.publish(state, manager.validator.refusals + further)

    def _publish_number(self, topic: str, value: float) -> None:
        if topic not in self._numbers:
            self._numbers[topic] = self._node.writer(topic, messages.NUMBER)
        self._numbers[topic].write(messages.make(messages.NUMBER, data=value))
