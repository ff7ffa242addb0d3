"""ROS's approximate time synchronisation, without ROS: which messages of several streams belong together."""

from collections import deque
from collections.abc import Iterable
from typing import Generic, NamedTuple, TypeVar

Item = TypeVar("Item")


class Message(NamedTuple, Generic[Item]):
    """What a stream brings.

    Attributes:
        stamp: the time that it is about, nanoseconds; streams are matched by it.
        arrival: when it came, nanoseconds, by the receiver's clock.
        item: what it holds.
    """

    stamp: int
    arrival: int
    item: Item


class _Candidate(NamedTuple, Generic[Item]):
    """The best match so far: its messages, and the earliest and the latest of their stamps."""

    messages: tuple[Message[Item], ...]
    start: int
    end: int


class Step(NamedTuple, Generic[Item]):
    """What became of the messages of some streams: they match, one of each stream, or will never be part of a match.

    Attributes:
        streams: their numbers.
        messages: theirs, in the same order.
        matched: whether they match.
    """

    streams: tuple[int, ...]
    messages: tuple[Message[Item], ...]
    matched: bool


class ApproximateTime(Generic[Item]):
    """Finds the messages, one of each stream, whose stamps lie nearest to one another; each is in one match at most.

    The rules are those of `message_filters::ApproximateTime` in ROS, for any number of streams. Every stream has a
    queue, in order of arrival. Once no queue is empty, their heads are looked at, and the earliest moves on, again and
    again. The first heads that lie near enough become the candidate, and the latest of them the pivot, which every
    better match contains. The candidate is published as soon as nothing better can come.

    Args:
        streams: how many, at least 1.
        max_interval: no match spans more, nanoseconds.
        lower_bound: the least that lies between two messages of a stream, nanoseconds. The nearer it is to the true
            period, the sooner it is known that nothing better can come; with 0, that is when the next round arrives.
        age_penalty: by how much a later match must be narrower to be better, at least 0.
        queue_size: messages that a stream keeps; of more, the oldest is dropped.
    """

    def __init__(
        self, streams: int, *, max_interval: int, lower_bound: int = 0, age_penalty: float = 0.1, queue_size: int = 100
    ) -> None:
        self._max_interval, self._lower_bound, self._queue_size = max_interval, lower_bound, queue_size
        self._lateness = 1 + age_penalty
        self._queues: list[deque[Message[Item]]] = [deque() for _ in range(streams)]
        self._aside: list[list[Message[Item]]] = [[] for _ in range(streams)]
        self._dropped = [False] * streams
        self._candidate: _Candidate[Item] | None = None
        self._pivot = self._pivot_stamp = 0  # of the candidate
        self._steps: list[Step[Item]] = []

    def add(self, stream: int, message: Message[Item]) -> list[Step[Item]]:
        """Take a message, and tell what it decides, in order.

        Args:
            stream: its number, from 0.
            message: the newest of the stream.
        """
        queue = self._queues[stream]
        queue.append(message)
        if len(queue) == 1:
            self._search()
        if len(queue) + len(self._aside[stream]) > self._queue_size:
            self._overflow(stream)
        steps, self._steps = self._steps, []
        return steps

    def settle(self) -> list[Step[Item]]:
        """Publish the candidate without waiting for a better one, and tell what that decides; nothing without one."""
        if self._candidate is not None:
            self._publish(self._candidate)
            self._search()
        steps, self._steps = self._steps, []
        return steps

    def waiting(self) -> list[tuple[int, Message[Item]]]:
        """All messages of which nothing is decided, with the numbers of their streams, in order of arrival."""
        both = zip(self._aside, self._queues, strict=True)
        kept = [(stream, message) for stream, parts in enumerate(both) for part in parts for message in part]
        return sorted(kept, key=lambda entry: entry[1].arrival)

    def _search(self) -> None:
        """Move on from heads to heads until a queue is empty."""
        while all(self._queues):
            heads = [queue[0].stamp for queue in self._queues]
            first, last = _earliest(heads), _latest(heads)
            start, end = heads[first], heads[last]
            self._dropped = [dropped and stream == last for stream, dropped in enumerate(self._dropped)]
            best = self._candidate
            if best is None:
                if end - start > self._max_interval or self._dropped[last]:
                    self._lose([first], [self._queues[first].popleft()])
                    continue
                self._pivot, self._pivot_stamp = last, end
            if best is None or (end - best.end) * self._lateness < start - best.start:
                best = self._nominate(start, end)
            self._aside[first].append(self._queues[first].popleft())
            if first == self._pivot or self._is_best(best, end) or (not all(self._queues) and self._proven(best)):
                self._publish(best)

    def _nominate(self, start: int, end: int) -> _Candidate[Item]:
        """Make the heads the candidate; what is older is in no match."""
        for stream, aside in enumerate(self._aside):
            self._lose([stream] * len(aside), aside)
            aside.clear()
        self._candidate = _Candidate(tuple(queue[0] for queue in self._queues), start, end)
        return self._candidate

    def _is_best(self, best: _Candidate[Item], end: int) -> bool:
        """Whether nothing better comes, where every further match reaches from the pivot to this end, or further."""
        return (end - best.end) * self._lateness >= self._pivot_stamp - best.start

    def _proven(self, best: _Candidate[Item]) -> bool:
        """Whether nothing better can come, if streams bring their next messages as early as they can."""
        at = [0] * len(self._queues)  # how far each stream has moved on
        while True:
            heads = [self._soonest(stream, moved) for stream, moved in enumerate(at)]
            first, last = _earliest(heads), _latest(heads)
            if self._is_best(best, heads[last]):
                return True
            if (heads[last] - best.end) * self._lateness < heads[first] - best.start:
                return False
            at[first] += 1

    def _soonest(self, stream: int, moved: int) -> int:
        """The stamp of a stream's next message after some more, or the earliest that it can have."""
        queue = self._queues[stream]
        if moved < len(queue):
            return queue[moved].stamp
        newest = queue[-1] if queue else self._aside[stream][-1]
        return max(self._pivot_stamp, newest.stamp + self._lower_bound)

    def _publish(self, best: _Candidate[Item]) -> None:
        self._steps.append(Step(tuple(range(len(self._queues))), best.messages, True))
        self._restore()
        for queue in self._queues:
            queue.popleft()  # what was older went when this one was nominated

    def _restore(self) -> None:
        """Put back what was set aside, and forget the candidate."""
        for queue, aside in zip(self._queues, self._aside, strict=True):
            queue.extendleft(reversed(aside))
            aside.clear()
        self._candidate = None

    def _overflow(self, stream: int) -> None:
        searched = self._candidate is not None
        self._restore()
        self._lose([stream], [self._queues[stream].popleft()])
        self._dropped[stream] = True
        if searched:
            self._search()

    def _lose(self, streams: Iterable[int], messages: Iterable[Message[Item]]) -> None:
        lost = zip(streams, messages, strict=True)
        self._steps.extend(Step((stream,), (message,), False) for stream, message in lost)


def _earliest(stamps: list[int]) -> int:
    """The place of the least; of several, the first."""
    return stamps.index(min(stamps))


def _latest(stamps: list[int]) -> int:
    """The place of the greatest; of several, the last."""
    return len(stamps) - 1 - stamps[::-1].index(max(stamps))
