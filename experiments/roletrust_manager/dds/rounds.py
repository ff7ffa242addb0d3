"""Assembly of messages into rounds when some are lost or late: the manager's deadlines around
synchronisation.
"""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Generic, NamedTuple

from roletrust_manager.admission.validation import StampLimits
from roletrust_manager.dds.synchroniser import (
    ApproximateTimeSynchroniser,
    Item,
    MatchDecision,
    Message,
)

_QUOTA = 10  # messages that a sender may send in a period; it needs one
_Named = list[tuple[str, Message[Item]]]


@dataclass(frozen=True)
class RoundTiming:
    """The waiting times of a round.

    Attributes:
        period: Time between rounds, nanoseconds.
        deadline: Time from the first message of an incomplete round to its end, as a share of the
            period.
        silence: Number of periods without a message after which a stream is no longer missing from
            a round.
        absence: Number of periods without a message after which no round waits for a stream until
            its deadline.
    """

    period: int
    deadline: float = 0.7
    silence: float = 3.0
    absence: float = 7200.0

    @property
    def max_spread(self) -> int:
        """Largest difference between the stamps of one round, nanoseconds: half a period."""
        return self.period // 2

    @property
    def tolerance(self) -> int:
        """Largest difference between the stamp of a message and the time of its arrival,
        nanoseconds: four periods.
        """
        return 4 * self.period

    @property
    def limits(self) -> StampLimits:
        """Limits on the stamps of messages that are sent once in a round."""
        return StampLimits(self.tolerance, self.max_spread)

    @property
    def quota(self) -> int:
        """Largest number of messages of a sender in a second: ten times what it needs, and at least
        ten.
        """
        return max(_QUOTA, math.ceil(_QUOTA * 1e9 / self.period))


class MatchedRound(NamedTuple, Generic[Item]):
    """Messages that belong together.

    Attributes:
        stamp: Earliest stamp of the messages, nanoseconds.
        items: Content of each stream's message.
        missing: Expected streams whose message did not arrive in time.
    """

    stamp: int
    items: dict[str, Item]
    missing: tuple[str, ...]


class RoundAssembler(Generic[Item]):
    """Closes complete rounds at once, and incomplete ones at a deadline with the messages that have
    arrived.

    ROS's synchronisation publishes complete matches only: a stream that loses a message costs all
    streams the round, and a stream that stops ends all rounds. Here the messages that it gives up
    form a partial round. A silent stream is not expected until it sends again, but rounds stay open
    for it until their deadline, so that its first message counts however late in the round it
    comes. Only after a long absence are rounds complete without it. A new stream is expected from
    its first message on. Rounds close in the order of their stamps, which begins anew when the
    clock is set back, see `StampLimits`. A message that arrives after its round was closed is in no
    round and is counted; this may happen to the first message of a new stream.

    Args:
        timing: How long to wait for a round.
        expected: Streams that are expected from the first message on.
        after: Rounds up to this stamp are closed already, nanoseconds; None if there is none.

    Attributes:
        unused: Number of messages in no round, by stream: late ones, and duplicates within a round.
    """

    def __init__(
        self, timing: RoundTiming, expected: Iterable[str] = (), after: int | None = None
    ) -> None:
        self._timing, self._after = timing, after
        self._initial, self._latest = tuple(expected), after or 0
        self._last_heard: dict[str, int] = {}
        self._silent = set[str]()
        self._parts: dict[str, Message[Item]] = {}  # of a round that will not be complete
        self._reset_synchroniser(())
        self.unused: Counter[str] = Counter()

    @property
    def expected(self) -> tuple[str, ...]:
        """Streams that a round should have: those that are not silent."""
        return tuple(name for name in self._streams if name not in self._silent)

    def add(self, name: str, stamp: int, item: Item, now: int) -> list[MatchedRound[Item]]:
        """Take a message and return the rounds that it closes.

        Args:
            name: Name of the stream, which may be new.
            stamp: Time stamp of the message, nanoseconds.
            item: Content of the message.
            now: Time of arrival, nanoseconds, by the clock of the stamps.
        """
        if not self._last_heard:
            self._last_heard = dict.fromkeys(self._initial, now)
            self._reset_synchroniser(self._initial)
        closed = self._begin_anew(now)
        self._last_heard[name] = max(
            now, stamp
        )  # a stream that is ahead is not silent before its round
        self._silent.discard(name)
        closed += [] if name in self._streams else self._wait_for((*self._streams, name))
        if self._is_closed(stamp):
            self.unused[name] += 1
            return closed
        return closed + self._apply(
            self._sync.add(self._streams.index(name), Message(stamp, now, item))
        )

    def close_due(self, now: int) -> list[MatchedRound[Item]]:
        """Return the rounds whose deadline has passed, and stop expecting silent streams. Call it
        often.
        """
        closed = self._begin_anew(now) + self._close_until(
            now - self._timing.deadline * self._timing.period
        )
        periods = {
            name: (now - self._last_heard[name]) / self._timing.period for name in self._streams
        }
        self._silent = {
            name for name, silence in periods.items() if silence >= self._timing.silence
        }
        streams = tuple(name for name, silence in periods.items() if silence < self._timing.absence)
        return closed + self._wait_for(streams) if streams != self._streams else closed

    def _begin_anew(self, now: int) -> list[MatchedRound[Item]]:
        """Close what waits if the clock has gone back; the stamps of later rounds may be those of
        earlier ones then.
        """
        closed = list[MatchedRound[Item]]()
        if self._latest > now + self._timing.limits.set_back:
            closed, self._after = self._close_until(math.inf), None
            self._last_heard, self._latest = dict.fromkeys(self._last_heard, now), now
        self._latest = max(self._latest, now)
        return closed

    def _close_until(self, latest: float) -> list[MatchedRound[Item]]:
        """Return the rounds whose first message is not later than a time, as far as they have
        come.
        """
        closed = list[MatchedRound[Item]]()
        while (start := self._wait_start()) is not None and start <= latest:
            decisions = (
                self._sync.publish_candidate()
            )  # its round may be closed already, and then it closes none
            closed += self._apply(decisions) if decisions else self._close_partial()
        return closed

    def _wait_start(self) -> int | None:
        """Return the time from which the deadline of the earliest round counts; None if no message
        waits.

        This is the arrival of the round's first message, or its stamp if that is later.
        """
        first = self._earliest_round([*self._parts.items(), *self._waiting()])
        return min((max(message.arrival, message.stamp) for _, message in first), default=None)

    def _earliest_round(self, messages: _Named[Item]) -> _Named[Item]:
        start = min((message.stamp for _, message in messages), default=0)
        return [
            (name, message)
            for name, message in messages
            if message.stamp - start <= self._timing.max_spread
        ]

    def _waiting(self) -> _Named[Item]:
        return [(self._streams[k], message) for k, message in self._sync.waiting()]

    def _close_partial(self) -> list[MatchedRound[Item]]:
        """Close the earliest round with the messages that have arrived."""
        pending = [*self._parts.items(), *self._waiting()]
        first, self._parts = self._earliest_round(pending), {}
        start = min(message.stamp for _, message in first)
        closed = self._close(first)
        self._reset_synchroniser(self._streams)
        return closed + self._feed(
            entry for entry in pending if entry[1].stamp - start > self._timing.max_spread
        )

    def _wait_for(self, names: tuple[str, ...]) -> list[MatchedRound[Item]]:
        """Change the streams of a complete round; a match that exists is published first."""
        closed = self._apply(self._sync.publish_candidate())
        waiting = self._waiting()
        self._reset_synchroniser(names)
        return closed + self._feed(waiting)

    def _reset_synchroniser(self, names: tuple[str, ...]) -> None:
        self._streams, period = names, self._timing.period
        self._sync: ApproximateTimeSynchroniser[Item] = ApproximateTimeSynchroniser(
            len(names), max_interval=self._timing.max_spread, lower_bound=4 * period // 5
        )

    def _feed(self, messages: Iterable[tuple[str, Message[Item]]]) -> list[MatchedRound[Item]]:
        """Add earlier messages again, whether or not rounds still wait for their streams."""
        closed = []
        for name, message in messages:
            if name in self._streams:
                closed += self._apply(self._sync.add(self._streams.index(name), message))
            else:
                closed += self._add_part(name, message)
        return closed

    def _apply(self, decisions: Iterable[MatchDecision[Item]]) -> list[MatchedRound[Item]]:
        """Return the rounds that some decisions of the synchroniser close."""
        closed = []
        for decision in decisions:
            pairs = zip(decision.streams, decision.messages, strict=True)
            messages = [(self._streams[k], message) for k, message in pairs]
            closed += (
                self._close_complete(messages) if decision.matched else self._add_part(*messages[0])
            )
        return closed

    def _close_complete(self, messages: _Named[Item]) -> list[MatchedRound[Item]]:
        """Close a complete round, after the partial rounds before it.

        A part of the same round is closed with it. The match has the newer message of its streams.
        """
        start, spread = min(message.stamp for _, message in messages), self._timing.max_spread
        parts, self._parts = self._parts, {}
        earlier = [entry for entry in parts.items() if start - entry[1].stamp > spread]
        same = [entry for entry in parts.items() if abs(start - entry[1].stamp) <= spread]
        self._parts = {name: part for name, part in parts.items() if part.stamp - start > spread}
        return self._close(earlier) + self._close(same + messages)

    def _add_part(self, name: str, message: Message[Item]) -> list[MatchedRound[Item]]:
        """Keep a message that will be in no complete round."""
        stamps = [message.stamp, *(part.stamp for part in self._parts.values())]
        another = name in self._parts or max(stamps) - min(stamps) > self._timing.max_spread
        closed = self._close_parts() if another else []
        self._parts[name] = message
        return closed

    def _close_parts(self) -> list[MatchedRound[Item]]:
        parts, self._parts = self._parts, {}
        return self._close(list(parts.items()))

    def _close(self, messages: _Named[Item]) -> list[MatchedRound[Item]]:
        """Return the round of some messages, without those of closed rounds; none if no message
        remains.
        """
        late = [name for name, message in messages if self._is_closed(message.stamp)]
        messages = [
            (name, message) for name, message in messages if not self._is_closed(message.stamp)
        ]
        self.unused.update(late)
        if not messages:
            return []
        stamp = min(message.stamp for _, message in messages)
        items = {name: message.item for name, message in messages}
        self.unused.update(
            (Counter(name for name, _ in messages) - Counter(list(items))).elements()
        )
        self._after = stamp
        return [
            MatchedRound(stamp, items, tuple(name for name in self.expected if name not in items))
        ]

    def _is_closed(self, stamp: int) -> bool:
        """Return whether the round of a stamp, or a later one, is closed."""
        return self._after is not None and stamp <= self._after + self._timing.max_spread
