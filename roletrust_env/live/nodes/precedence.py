"""Precedence among managers: at most one manager of a team publishes trust."""

import time
from collections.abc import Iterable

from roletrust_env.live.message_validation import MANAGER, Keyring, MessageValidator, RefusalReason
from roletrust_env.live.nodes.diagnostics import INTERVAL_S, LIMITS, MAX_PER_SECOND
from roletrust_env.live.nodes.signatures import read_diagnostics
from roletrust_env.live.nodes.topics import DIAGNOSTICS, TRUST
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Publication, Quota

DISCOVERY_S = 1.0  # nodes of one machine find each other within that time


class Precedence:
    """Decides whether this manager may publish trust when others do.

    With keys, only a holder of the manager's key counts: its signed diagnostics name its writer of trust. Messages from
    before the start of this manager do not count, so the messages of a killed manager cannot be sent again to stop
    this one. Without keys, every writer of trust counts. If two managers start at the same time, exactly one of them
    has precedence.

    Args:
        node: Node of this manager.
        keyring: Keys of the team; None if there are none.

    Attributes:
        validator: Counts forged diagnostics.
    """

    def __init__(self, node: Node, keyring: Keyring | None) -> None:
        self._node, self._keyring, self._began = node, keyring, time.time_ns()
        self._reader = node.reader(DIAGNOSTICS, messages.DIAGNOSTICS, depth=100, quota=Quota(MAX_PER_SECOND))
        self._others = set[str]()
        self.validator = MessageValidator(LIMITS, keyring)

    def wait_for_others(self) -> bool:
        """Wait until other managers would be known, and return whether there is one."""
        time.sleep(DISCOVERY_S)
        if not self._node.writers_of(TRUST):
            return False
        if self._keyring is None:
            return True
        end = time.monotonic() + 2 * INTERVAL_S
        while not self._others and time.monotonic() < end:
            self._node.wait(end - time.monotonic())
            self._read("")
        return bool(self._others)

    def update(self, own: str, publications: Iterable[Publication]) -> None:
        """Look for other managers.

        Args:
            own: Writer of trust of this manager.
            publications: New publications.
        """
        self._read(own)
        if self._keyring is None and any(one.topic == TRUST for one in publications):
            self._others = {*self._node.writers_of(TRUST)} - {own}

    def _read(self, own: str) -> None:
        """Read the diagnostics of other managers."""
        for raw in self._reader.take():
            try:
                report = read_diagnostics(raw)
            except ValueError:
                self.validator.refuse("", RefusalReason.GARBAGE)
                continue
            if report is None or report.node != MANAGER or self._keyring is None:
                continue  # other nodes publish diagnostics of their own
            if self.validator.accepts(report.envelope, time.time_ns()) and report.envelope.stamp >= self._began:
                self._others |= {report.values.get("writer", "")} - {own}
        if self._reader.over_quota:
            self.validator.refuse("", RefusalReason.FLOOD, self._reader.over_quota)
            self._reader.over_quota = 0

    def is_second(self, own: str) -> bool:
        """Return whether another manager publishes trust as well and has precedence.

        Args:
            own: Writer of trust of this manager.
        """
        return any(other < own for other in self._others)
