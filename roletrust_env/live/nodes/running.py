"""What all nodes share: the clock, the rounds by it, how they are stopped, and what they hear of trust."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roletrust_env.live.nodes.topics import RATINGS, TRUST
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node

SECOND = 1_000_000_000


class Timeline(NamedTuple):
    """When rounds begin, by the clock of this machine.

    Attributes:
        start: of round 0, nanoseconds since 1970.
        period: between rounds, nanoseconds.
    """

    start: int
    period: int

    @classmethod
    def aligned(cls, period: int) -> "Timeline":
        """One that begins with the next whole period since 1970: all who count so agree on where rounds begin."""
        return cls((time.time_ns() // period + 1) * period, period)

    def begin(self, round: int) -> int:
        """The stamp of a round."""
        return self.start + round * self.period

    def round(self, stamp: int) -> int:
        """The round that a stamp is next to; negative before the start."""
        return (stamp - self.start + self.period // 2) // self.period


class Running:
    """Whether a node goes on: until it is told to end (SIGTERM, or Ctrl-C)."""

    def __init__(self) -> None:
        self._told = False

    def __bool__(self) -> bool:
        return not self._told

    def stop(self, *_: object) -> None:
        """End soon."""
        self._told = True

    def sleep_until(self, moment: int) -> None:
        """Wait for a moment, nanoseconds since 1970, or until the node is to end."""
        while self and (left := moment - time.time_ns()) > 0:
            time.sleep(min(left / SECOND, 0.1))


@contextmanager
def running() -> Iterator[Running]:
    """A node that ends when it is told to, and then as if its work were done."""
    state = Running()
    before = {number: signal.signal(number, state.stop) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield state
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class Bulletin:
    """The trust that was published last, as agents hear it.

    Args:
        node: that hears it.
        initial: the trust of those of whom nothing was published yet.
    """

    def __init__(self, node: Node, initial: float) -> None:
        self._reader, self._initial = node.reader(TRUST, messages.TRUST), initial
        self._tor: dict[str, float] = {}
        self._top: dict[str, float] = {}

    def hear(self) -> None:
        """Take what came since the last time."""
        for raw in self._reader.take():
            with suppress(ValueError):  # whoever sends what cannot be read is not the manager
                _, _, self._tor, self._top, _ = messages.read_trust(raw)

    def tor(self, rater: str) -> float:
        """The trust of a rater."""
        return self._tor.get(rater, self._initial)

    def top(self, provider: str) -> float:
        """The trust of a provider."""
        return self._top.get(provider, self._initial)


class Reviews:
    """The ratings of a provider, as it overhears them: whoever is on the network may.

    Args:
        node: that hears them.
        provider: whom they are of.
        raters: whose they are; others are not heard.
    """

    def __init__(self, node: Node, provider: str, raters: tuple[str, ...]) -> None:
        self._provider, self._raters = provider, raters
        self._readers = [node.reader(f"/{rater}{RATINGS}", messages.RATINGS) for rater in raters]

    def hear(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """The newest of each rater since the last time, 0 where there is none, and where there is one, (S,) each."""
        ratings, rated = np.zeros(len(self._raters)), np.zeros(len(self._raters), bool)
        for place, reader in enumerate(self._readers):
            for raw in reader.take():
                with suppress(ValueError, KeyError):  # what cannot be read, or is not of this provider
                    said = messages.read_ratings(raw)
                    rating = dict(zip(said.providers, said.values, strict=True))[self._provider]
                    rated[place] = 0 <= rating <= 1
                    ratings[place] = rating if rated[place] else 0.0
        return ratings, rated
