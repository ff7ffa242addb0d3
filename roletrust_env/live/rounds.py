"""Which messages make a round, when some are lost, late or never come: a manager's policy around synchronisation."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Generic, NamedTuple

from roletrust_env.live.synchroniser import ApproximateTime, Item, Message, Step

_Named = list[tuple[str, Message[Item]]]


@dataclass(frozen=True)
class Patience:
    """How long a round is waited for.

    Attributes:
        period: between rounds, nanoseconds.
        deadline: a round that is not complete is closed so long after its first message came, as a share of the period.
        silence: whoever was not heard for so many periods is no longer waited for.
    """

    period: int
    deadline: float = 0.7
    silence: float = 3.0

    @property
    def apart(self) -> int:
        """Messages whose stamps lie further apart are not of one round, nanoseconds: half a period."""
        return self.period // 2

    @property
    def tolerance(self) -> int:
        """How far the stamp of a message may be from the time of its arrival, nanoseconds: four periods."""
        return 4 * self.period


class Round(NamedTuple, Generic[Item]):
    """Messages that belong together.

    Attributes:
        stamp: the earliest of theirs, nanoseconds.
        items: what each stream brought.
        missing: streams that were waited for, in vain.
    """

    stamp: int
    items: dict[str, Item]
    missing: tuple[str, ...]


class Rounds(Generic[Item]):
    """Closes rounds: complete ones as soon as they are, others at a deadline, with what there is.

    ROS's synchronisation alone publishes complete matches only, so that a stream that loses a message costs all of them
    a round, and one that stops, everything. Here what it gives up makes a partial round. Streams that fall silent are
    no longer waited for, until they speak again; who speaks for the first time is waited for from then on. Rounds close
    in the order of their stamps: what comes after its round was closed is in none, and counted, as may be the first
    word of who was not waited for.

    Args:
        patience: how long a round is waited for.
        expected: streams that are waited for from the first message on.
        after: rounds up to this stamp are closed, nanoseconds; None if none is.

    Attributes:
        unused: messages that are in no round, by stream: they came too late, or were not the only one of their stream.
    """

    def __init__(self, patience: Patience, expected: Iterable[str] = (), after: int | None = None) -> None:
        self._patience, self._after = patience, after
        self._expected = tuple(expected)
        self._heard: dict[str, int] = {}
        self._parts: dict[str, Message[Item]] = {}  # of a round that will not be complete
        self._seat(())
        self.unused: Counter[str] = Counter()

    @property
    def waited_for(self) -> tuple[str, ...]:
        """The streams that a round needs to be complete."""
        return self._names

    def add(self, name: str, stamp: int, item: Item, now: int) -> list[Round[Item]]:
        """Take a message, and close what it completes.

        Args:
            name: of the stream; it may be a new one.
            stamp: the time that it is about, nanoseconds.
            item: what it holds.
            now: the time at which it came, nanoseconds, by the clock of the stamps.
        """
        if not self._heard:
            self._heard = dict.fromkeys(self._expected, now)
            self._seat(self._expected)
        self._heard[name] = max(now, stamp)  # who is ahead is not silent before its round
        closed = [] if name in self._names else self._wait_for((*self._names, name))
        if self._is_closed(stamp):
            self.unused[name] += 1
            return closed
        return closed + self._settled(self._sync.add(self._names.index(name), Message(stamp, now, item)))

    def due(self, now: int) -> list[Round[Item]]:
        """Close what was waited for long enough, and wait no longer for the silent. To be asked often."""
        closed = []
        while (ready := self._ready()) is not None and now - ready >= self._patience.deadline * self._patience.period:
            closed += self._settled(self._sync.settle()) or self._close_partial()
        patient = self._patience.silence * self._patience.period
        speaking = tuple(name for name in self._names if now - self._heard[name] < patient)
        return closed + self._wait_for(speaking) if speaking != self._names else closed

    def _ready(self) -> int | None:
        """When the first message of the earliest round came; if that is stamped later, when it is meant for."""
        first = self._first([*self._parts.items(), *self._waiting()])
        return min((max(message.arrival, message.stamp) for _, message in first), default=None)

    def _first(self, messages: _Named[Item]) -> _Named[Item]:
        """Those of some messages that are of the earliest round."""
        start = min((message.stamp for _, message in messages), default=0)
        return [(name, message) for name, message in messages if message.stamp - start <= self._patience.apart]

    def _waiting(self) -> _Named[Item]:
        return [(self._names[k], message) for k, message in self._sync.waiting()]

    def _close_partial(self) -> list[Round[Item]]:
        """Close the earliest round with what there is of it."""
        here = [*self._parts.items(), *self._waiting()]
        first, self._parts = self._first(here), {}
        start = min(message.stamp for _, message in first)
        closed = self._close(first)
        self._seat(self._names)
        return closed + self._feed(entry for entry in here if entry[1].stamp - start > self._patience.apart)

    def _wait_for(self, names: tuple[str, ...]) -> list[Round[Item]]:
        """Wait for others than before; a match that is there is not waited with."""
        closed = self._settled(self._sync.settle())
        waiting = self._waiting()
        self._seat(names)
        return closed + self._feed(waiting)

    def _seat(self, names: tuple[str, ...]) -> None:
        self._names, period = names, self._patience.period
        self._sync: ApproximateTime[Item] = ApproximateTime(
            len(names), max_interval=self._patience.apart, lower_bound=4 * period // 5
        )

    def _feed(self, messages: Iterable[tuple[str, Message[Item]]]) -> list[Round[Item]]:
        """Messages that came before, of streams that are waited for or not."""
        closed = []
        for name, message in messages:
            if name in self._names:
                closed += self._settled(self._sync.add(self._names.index(name), message))
            else:
                closed += self._set_apart(name, message)
        return closed

    def _settled(self, steps: Iterable[Step[Item]]) -> list[Round[Item]]:
        """The rounds that some decisions close."""
        closed = []
        for step in steps:
            messages = [(self._names[k], message) for k, message in zip(step.streams, step.messages, strict=True)]
            closed += self._complete(messages) if step.matched else self._set_apart(*messages[0])
        return closed

    def _complete(self, messages: _Named[Item]) -> list[Round[Item]]:
        """A complete round; of its parts that were set apart, newer ones of the same streams are in it."""
        start, apart = min(message.stamp for _, message in messages), self._patience.apart
        parts, self._parts = self._parts, {}
        earlier = [entry for entry in parts.items() if start - entry[1].stamp > apart]
        same = [entry for entry in parts.items() if abs(start - entry[1].stamp) <= apart]
        self._parts = {name: part for name, part in parts.items() if part.stamp - start > apart}
        return self._close(earlier) + self._close(same + messages)

    def _set_apart(self, name: str, message: Message[Item]) -> list[Round[Item]]:
        """Keep a message that will not be in a complete round."""
        stamps = [message.stamp, *(part.stamp for part in self._parts.values())]
        another = name in self._parts or max(stamps) - min(stamps) > self._patience.apart
        closed = self._close_parts() if another else []
        self._parts[name] = message
        return closed

    def _close_parts(self) -> list[Round[Item]]:
        parts, self._parts = self._parts, {}
        return self._close(list(parts.items()))

    def _close(self, messages: _Named[Item]) -> list[Round[Item]]:
        """A round of some messages, unless there are none or it was closed before."""
        stamp = min((message.stamp for _, message in messages), default=0)
        if not messages or self._is_closed(stamp):
            self.unused.update(name for name, _ in messages)
            return []
        items = {name: message.item for name, message in messages}
        self.unused.update((Counter(name for name, _ in messages) - Counter(list(items))).elements())
        self._after = stamp
        return [Round(stamp, items, tuple(name for name in self._names if name not in items))]

    def _is_closed(self, stamp: int) -> bool:
        """Whether the round of a stamp is closed, or a later one."""
        return self._after is not None and stamp <= self._after + self._patience.apart
