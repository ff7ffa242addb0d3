"""ROS's approximate time synchronisation without ROS: which messages of several streams belong
together.
"""

from collections.abc import Iterable
from typing import Generic, NamedTuple, TypeVar

Item = TypeVar("Item")


class Message(NamedTuple, Generic[Item]):
    """A message of a stream.

    Attributes:
        stamp: Time stamp, nanoseconds; streams are matched by it.
        arrival: Time of arrival, nanoseconds, by the receiver's clock.
        item: Content.
    """

    stamp: int
    arrival: int
    item: Item


class _Candidate(NamedTuple, Generic[Item]):
    """The best match so far: its messages, and their earliest and latest stamp."""

    messages: tuple[Message[Item], ...]
    start: int
    end: int


class MatchDecision(NamedTuple, Generic[Item]):
    """A decision on messages: they match, one of each stream, or a message will never be part of a
    match.

    Attributes:
        streams: Numbers of the streams.
        messages: Message of each of these streams.
        matched: Whether they match.
    """

    streams: tuple[int, ...]
    messages: tuple[Message[Item], ...]
    matched: bool


class ApproximateTimeSynchroniser(Generic[Item]):
    """Matches messages of several streams, one of each, whose stamps are closest; no message is in
    two matches.

    The rules are those of `message_filters::ApproximateTime` in ROS, for any number of streams.
    Every stream has a queue in the order of arrival. Once no queue is empty, the heads of all
    queues are compared and the earliest is set aside, again and again. The first heads that are
    close enough become the candidate. The latest of them is the pivot, which every better match
    contains. The candidate is published as soon as no better match can come.

    Args:
        streams: Number of streams, at least 1.
        max_interval: Largest difference between the stamps of a match, nanoseconds.
        lower_bound: Smallest difference between two successive messages of a stream, nanoseconds.
            The closer it is to the true period, the sooner a match is published; with 0, a match
            waits for the next round to arrive.
        age_penalty: Relative amount by which a later match must be narrower to be better, at least
            0.
        queue_size: Number of messages that each queue holds; beyond that, the oldest is dropped.
    """

    def __init__(
        self,
        streams: int,
        *,
        max_interval: int,
        lower_bound: int = 0,
        age_penalty: float = 0.1,
        queue_size: int = 100,
    ) -> None:
        self._max_interval, self._lower_bound, self._queue_size = (
            max_interval,
            lower_bound,
            queue_size,
        )
        self._lateness = 1 + age_penalty
        self._queues: list[list[Message[Item]]] = [[] for _ in range(streams)]
        self._aside: list[list[Message[Item]]] = [[] for _ in range(streams)]
        self._dropped = [False] * streams
        self._candidate: _Candidate[Item] | None = None
        self._pivot = self._pivot_stamp = 0  # of the candidate
        self._decisions: list[MatchDecision[Item]] = []

    def add(self, stream: int, message: Message[Item]) -> list[MatchDecision[Item]]:
        """Take a message and return the decisions that follow, in order.

        Args:
            stream: Number of the stream, from 0.
            message: Newest message of the stream.
        """
        queue = self._queues[stream]
        queue.append(message)
        if len(queue) == 1:
            self._search()
        if len(queue) + len(self._aside[stream]) > self._queue_size:
            self._overflow(stream)
        decisions, self._decisions = self._decisions, []
        return decisions

    def publish_candidate(self) -> list[MatchDecision[Item]]:
        """Publish the candidate, if there is one, without waiting for a better match, and return
        the decisions.
        """
        if self._candidate is not None:
            self._publish(self._candidate)
            self._search()
        decisions, self._decisions = self._decisions, []
        return decisions

    def waiting(self) -> list[tuple[int, Message[Item]]]:
        """Return all undecided messages with the numbers of their streams, in order of arrival."""
        both = zip(self._aside, self._queues, strict=True)
        undecided = [
            (stream, message)
            for stream, parts in enumerate(both)
            for part in parts
            for message in part
        ]
        return sorted(undecided, key=lambda entry: entry[1].arrival)

    def _search(self) -> None:
        """Compare heads and set the earliest aside until a queue is empty."""
        while all(self._queues):
            heads = [queue[0].stamp for queue in self._queues]
            first, last = _earliest(heads), _latest(heads)
            start, end = heads[first], heads[last]
            self._dropped = [
                dropped and stream == last for stream, dropped in enumerate(self._dropped)
            ]
            best = self._candidate
            if best is None:
                if end - start > self._max_interval or self._dropped[last]:
                    self._discard([first], [self._queues[first].pop(0)])
                    continue
                self._pivot, self._pivot_stamp = last, end
            if best is None or (end - best.end) * self._lateness < start - best.start:
                best = self._nominate(start, end)
            self._aside[first].append(self._queues[first].pop(0))
            if (
                first == self._pivot
                or self._is_best(best, end)
                or (not all(self._queues) and self._proven(best))
            ):
                self._publish(best)

    def _nominate(self, start: int, end: int) -> _Candidate[Item]:
        """Make the heads the candidate; older messages are in no match."""
        for stream, aside in enumerate(self._aside):
            self._discard([stream] * len(aside), aside)
            aside.clear()
        self._candidate = _Candidate(tuple(queue[0] for queue in self._queues), start, end)
        return self._candidate

    def _is_best(self, best: _Candidate[Item], end: int) -> bool:
        """Return whether no match is better that reaches from the pivot to this end or beyond."""
        return (end - best.end) * self._lateness >= self._pivot_stamp - best.start

    def _proven(self, best: _Candidate[Item]) -> bool:
        """Return whether no better match can come, even if all streams send as early as they
        can.
        """
        at = [0] * len(self._queues)  # position of each stream beyond its head
        while True:
            heads = [self._earliest_stamp(stream, offset) for stream, offset in enumerate(at)]
            first, last = _earliest(heads), _latest(heads)
            if self._is_best(best, heads[last]):
                return True
            if (heads[last] - best.end) * self._lateness < heads[first] - best.start:
                return False
            at[first] += 1

    def _earliest_stamp(self, stream: int, offset: int) -> int:
        """Return the stamp of a message that many places behind the head, or the earliest that it
        can have.
        """
        queue = self._queues[stream]
        if offset < len(queue):
            return queue[offset].stamp
        newest = queue[-1] if queue else self._aside[stream][-1]
        return max(self._pivot_stamp, newest.stamp + self._lower_bound)

    def _publish(self, best: _Candidate[Item]) -> None:
        self._decisions.append(MatchDecision(tuple(range(len(self._queues))), best.messages, True))
        self._restore()
        for queue in self._queues:
            queue.pop(0)  # older ones were discarded when this one was nominated

    def _restore(self) -> None:
        """Put back the messages that were set aside, and drop the candidate."""
        for queue, aside in zip(self._queues, self._aside, strict=True):
            queue[:0] = aside
            aside.clear()
        self._candidate = None

    def _overflow(self, stream: int) -> None:
        had_candidate = self._candidate is not None
        self._restore()
        self._discard([stream], [self._queues[stream].pop(0)])
        self._dropped[stream] = True
        if had_candidate:
            self._search()

    def _discard(self, streams: Iterable[int], messages: Iterable[Message[Item]]) -> None:
        pairs = zip(streams, messages, strict=True)
        self._decisions.extend(
            MatchDecision((stream,), (message,), False) for stream, message in pairs
        )


def _earliest(stamps: list[int]) -> int:
    """Return the index of the smallest stamp; the first of equal ones."""
    return stamps.index(min(stamps))


def _latest(stamps: list[int]) -> int:
    """Return the index of the largest stamp; the last of equal ones."""
    return len(stamps) - 1 - stamps[::-1].index(max(stamps))
