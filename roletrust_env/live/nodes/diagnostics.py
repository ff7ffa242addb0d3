"""Diagnostics of a node: its state and the messages that it refused, once a second."""

import time
from collections.abc import Mapping

from roletrust_env.live.message_validation import RefusalReason, StampLimits
from roletrust_env.live.nodes.run_loop import SECOND
from roletrust_env.live.nodes.signatures import signed_diagnostics
from roletrust_env.live.nodes.topics import DIAGNOSTICS
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node
from roletrust_env.live.wire.keys import Signer

INTERVAL_S = 1.0
MAX_PER_SECOND = 100
"""Messages that a node may send on a topic of all, such as `/diagnostics`."""

LIMITS = StampLimits(tolerance=10 * SECOND, min_gap=1)
"""Limits on the stamps of trust and diagnostics: a message that is sent again within the tolerance has an old stamp."""


class DiagnosticsPublisher:
    """Publishes the state of a node for the tools of ROS 2 and the live page.

    Args:
        node: Node that publishes.
        name: Name of the node in the messages, and of its key.
        signer: Private key; None does not sign.
    """

    def __init__(self, node: Node, name: str, signer: Signer | None) -> None:
        self._writer, self._name, self._signer = node.writer(DIAGNOSTICS, messages.DIAGNOSTICS), name, signer
        self._last_s = 0.0

    @property
    def is_due(self) -> bool:
        """True if the last message is an interval old."""
        return time.monotonic() - self._last_s >= INTERVAL_S

    def publish(self, state: Mapping[str, str], refusals: Mapping[tuple[str, RefusalReason], int]) -> None:
        """Publish the state of the node and its refusals by sender and reason."""
        self._last_s = time.monotonic()
        counts = {f"{sender or 'unknown'}: {reason}": str(count) for (sender, reason), count in refusals.items()}
        values = {**state, **counts}
        self._writer.write(signed_diagnostics(time.time_ns(), self._name, bool(counts), values, self._signer))
