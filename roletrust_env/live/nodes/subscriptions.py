"""Subscriptions of agents: the published trust, and the ratings of a provider."""

import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from roletrust_env.live.journal import PublishedTrust
from roletrust_env.live.message_validation import (
    MANAGER,
    Envelope,
    Keyring,
    MessageValidator,
    RefusalReason,
    StampLimits,
)
from roletrust_env.live.nodes.diagnostics import LIMITS, MAX_PER_SECOND
from roletrust_env.live.nodes.signatures import read_trust
from roletrust_env.live.nodes.topics import RATINGS, TRUST
from roletrust_env.live.rounds import RoundTiming
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Quota


class TrustInbox:
    """Receives the published trust. With keys, it counts only if the manager has signed it.

    Args:
        node: Node that subscribes.
        keyring: Keys of the team, with the manager's; None accepts every message.

    Attributes:
        validator: Refuses invalid messages and counts them.
    """

    def __init__(self, node: Node, keyring: Keyring | None) -> None:
        self._reader = node.reader(TRUST, messages.TRUST, depth=100, quota=Quota(MAX_PER_SECOND))
        self.validator = MessageValidator(LIMITS, keyring)

    def take(self) -> Iterator[PublishedTrust]:
        """Iterate over the valid messages since the last call."""
        for raw in self._reader.take():
            try:
                trust, envelope = read_trust(raw)
            except ValueError:
                self.validator.refuse(MANAGER, RefusalReason.GARBAGE)
                continue
            if self.validator.accepts(envelope, time.time_ns()):
                yield trust
        if self._reader.over_quota:
            self.validator.refuse(MANAGER, RefusalReason.FLOOD, self._reader.over_quota)
            self._reader.over_quota = 0


class TrustSubscription:
    """The most recently published trust.

    Args:
        node: Node that subscribes.
        initial: Trust of agents about which nothing has been published.
        keyring: See `TrustInbox`.

    Attributes:
        inbox: Incoming messages.
    """

    def __init__(self, node: Node, initial: float, keyring: Keyring | None = None) -> None:
        self.inbox, self._initial = TrustInbox(node, keyring), initial
        self._tor: dict[str, float] = {}
        self._top: dict[str, float] = {}

    def update(self) -> None:
        """Read the new messages."""
        for trust in self.inbox.take():
            self._tor, self._top = trust.tor, trust.top

    def tor(self, rater: str) -> float:
        """Return the trust of a rater."""
        return self._tor.get(rater, self._initial)

    def top(self, provider: str) -> float:
        """Return the trust of a provider."""
        return self._top.get(provider, self._initial)


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
        self, node: Node, provider: str, raters: tuple[str, ...], timing: RoundTiming, keyring: Keyring | None = None
    ) -> None:
        self._provider, self._raters = provider, raters
        self._readers = [node.reader(f"/{rater}{RATINGS}", messages.RATINGS) for rater in raters]
        self._validator = MessageValidator(StampLimits(timing.tolerance, timing.max_spread), keyring)

    def take(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the newest rating of each rater since the last call, and a mask of where there is one, (S,) each.

        The rating is 0 where there is none.
        """
        ratings, rated = np.zeros(len(self._raters)), np.zeros(len(self._raters), bool)
        for place, (rater, reader) in enumerate(zip(self._raters, self._readers, strict=True)):
            for raw in reader.take():
                rating = self._rating(rater, raw)
                if rating is not None:
                    rated[place] = 0 <= rating <= 1
                    ratings[place] = rating if rated[place] else 0.0
        return ratings, rated

    def _rating(self, rater: str, raw: bytes) -> float | None:
        """Return the rating of the provider in a message; None if it is invalid or has none."""
        try:
            one = messages.read_ratings(raw)
        except ValueError:
            return None
        if one.rater != rater or len(one.providers) != len(one.values):
            return None
        if not self._validator.accepts(Envelope(one.rater, one.stamp, one.signed, one.signature), time.time_ns()):
            return None
        return dict(zip(one.providers, one.values, strict=True)).get(self._provider)
