"""Subscriptions of agents: the published trust, and the ratings of a provider."""

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from roletrust_env.live.nodes.topics import RATINGS, TRUST
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node


class TrustSubscription:
    """The most recently published trust.

    Args:
        node: Node that subscribes.
        initial: Trust of agents about which nothing has been published.
    """

    def __init__(self, node: Node, initial: float) -> None:
        self._reader, self._initial = node.reader(TRUST, messages.TRUST), initial
        self._tor: dict[str, float] = {}
        self._top: dict[str, float] = {}

    def update(self) -> None:
        """Read the new messages."""
        for raw in self._reader.take():
            with suppress(ValueError):  # a message that cannot be read is not the manager's
                _, _, self._tor, self._top, _ = messages.read_trust(raw)

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
    """

    def __init__(self, node: Node, provider: str, raters: tuple[str, ...]) -> None:
        self._provider, self._raters = provider, raters
        self._readers = [node.reader(f"/{rater}{RATINGS}", messages.RATINGS) for rater in raters]

    def take(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the newest rating of each rater since the last call, and a mask of where there is one, (S,) each.

        The rating is 0 where there is none.
        """
        ratings, rated = np.zeros(len(self._raters)), np.zeros(len(self._raters), bool)
        for place, reader in enumerate(self._readers):
            for raw in reader.take():
                with suppress(ValueError, KeyError):  # unreadable, or without a rating of this provider
                    message = messages.read_ratings(raw)
                    rating = dict(zip(message.providers, message.values, strict=True))[self._provider]
                    rated[place] = 0 <= rating <= 1
                    ratings[place] = rating if rated[place] else 0.0
        return ratings, rated
