"""Validation of incoming messages: which of them count, which newcomers may join, and why the
others are refused.
"""

import math
from collections import Counter
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from threading import Lock
from typing import NamedTuple, Protocol

from roletrust_manager.team import Team

MANAGER = "manager"
"""Name of the manager and of its key."""

MAX_STRANGERS = 8
"""Agents of a role that may take part without a key and without a place in the scenario."""

_MINUTE = 60 * 10**9
_NEWCOMERS = 10  # of a team that may join in a period
_REMEMBERED = (
    1000  # senders that are remembered without keys, so that fresh names do not fill the memory
)


class Envelope(NamedTuple):
    """The origin of a message.

    Attributes:
        sender: Name of the sender, as the message gives it.
        stamp: Time stamp, nanoseconds.
        signed: Bytes that the signature covers.
        signature: Signature; empty if there is none.
        nonce: Text that only one message of a stamp has; empty if no other may have the stamp.
    """

    sender: str
    stamp: int
    signed: bytes = b""
    signature: bytes = b""
    nonce: str = ""


class LastStamp(NamedTuple):
    """The last stamp of a sender.

    Attributes:
        stamp: Time stamp, nanoseconds.
        nonces: Nonces of the messages with that stamp.
    """

    stamp: int
    nonces: frozenset[str] = frozenset()


def following(last: LastStamp | None, envelope: Envelope) -> LastStamp | None:
    """Return the last stamp of a sender after another message; None if the message is not new: it
    is not later, nor of the same stamp with another nonce.
    """
    nonces = frozenset({envelope.nonce} - {""})
    if last is None or envelope.stamp > last.stamp:
        return LastStamp(envelope.stamp, nonces)
    if envelope.stamp < last.stamp or not last.nonces or nonces <= last.nonces:
        return None
    return LastStamp(envelope.stamp, last.nonces | nonces)


class RatingMessage(NamedTuple):
    """A message with a rater's ratings of the services of one round.

    Attributes:
        envelope: Origin of the message: the rater, and the time stamp of the services.
        providers: Names of the rated providers.
        values: Ratings, in the order of the providers.
    """

    envelope: Envelope
    providers: Sequence[str]
    values: Sequence[float]


class RefusalReason(StrEnum):
    """Reason for a refusal: down to `CROWDED` of a whole message, from `UNKNOWN_PROVIDER` on of a
    single rating.
    """

    FLOOD = "too many messages"
    GARBAGE = "garbage"
    TOO_LARGE = "too large"
    ELSEWHERE = "in the wrong place"
    UNKNOWN = "unknown sender"
    FUTURE = "stamp from the future"
    PAST = "stamp from the past"
    CLOCK = "the clock has gone back"
    REPLAYED = "replayed"
    TOO_SOON = "too soon after the last"
    UNSIGNED = "unsigned"
    MIS_SIGNED = "mis-signed"
    NO_WORK = "without work"
    TAKEN = "name taken"
    CROWDED = "too many newcomers"
    UNKNOWN_PROVIDER = "unknown provider"
    ITSELF = "rates itself"
    DOUBLED = "doubled"
    NOT_A_NUMBER = "not a number"
    OUT_OF_RANGE = "out of range"


class Verdict(NamedTuple):
    """What is decided about a report.

    Attributes:
        reason: Reason why it is refused as a whole; None if it is not.
        ratings: Ratings that count, by provider.
    """

    reason: RefusalReason | None
    ratings: dict[str, float]


class Keyring(Protocol):
    """The known senders and a check of their signatures."""

    def __contains__(self, sender: object) -> bool:
        """Return whether a sender of that name is known."""

    def verifies(self, sender: str, signed: bytes, signature: bytes) -> bool:
        """Return whether a signature of some bytes is that of a known sender."""


class KeysOfOthers:
    """A keyring without some names, such as those that have another role.

    Args:
        keyring: Known senders.
        names: Names that are not known here.
    """

    def __init__(self, keyring: Keyring, names: Iterable[str]) -> None:
        self._keyring, self._names = keyring, frozenset(names)

    def __contains__(self, sender: object) -> bool:
        """Return whether a sender of that name is known, see `Keyring`."""
        return sender not in self._names and sender in self._keyring

    def verifies(self, sender: str, signed: bytes, signature: bytes) -> bool:
        """Return whether a signature is valid, see `Keyring.verifies`."""
        return sender in self and self._keyring.verifies(sender, signed, signature)


def keys_by_role(keyring: Keyring | None, team: Team) -> tuple[Keyring | None, Keyring | None]:
    """Return the keys of those that may rate and of those that may serve; None where there are no
    keys.
    """
    if keyring is None:
        return None, None
    raters, providers = set(team.raters), set(team.providers)
    return (
        KeysOfOthers(keyring, {MANAGER} | (providers - raters)),
        KeysOfOthers(keyring, {MANAGER} | (raters - providers)),
    )


def is_genuine(envelope: Envelope, keyring: Keyring | None) -> bool:
    """Return whether a message is from the sender that it names, at any time; without keys, every
    message is.
    """
    if keyring is None:
        return True
    return envelope.sender in keyring and keyring.verifies(
        envelope.sender, envelope.signed, envelope.signature
    )


@dataclass(frozen=True)
class StampLimits:
    """Limits on the time stamps of messages.

    Attributes:
        tolerance: Largest difference between a stamp and the time of arrival, nanoseconds.
        min_gap: Smallest difference between two stamps of one sender, nanoseconds; for example half
            a period. It limits the share of the rounds, and of the receiver's time, that one sender
            can take.
    """

    tolerance: int
    min_gap: int

    @property
    def set_back(self) -> int:
        """Time by which a clock must go back to be one that was set, nanoseconds; a shorter time
        soon passes.
        """
        return max(self.tolerance, _MINUTE)


class NewcomerLimit:
    """Limits how many newcomers join in a period.

    Args:
        most: Number of newcomers in a period.
        period: Length of a period, nanoseconds.
    """

    def __init__(self, most: int, period: int) -> None:
        self._most, self._period = most, period
        self._start, self._joined = 0, 0

    @property
    def state(self) -> tuple[int, int]:
        """Start of the running period, nanoseconds, and number of its newcomers so far."""
        return self._start, self._joined

    @state.setter
    def state(self, state: tuple[int, int]) -> None:
        self._start, self._joined = state

    def admits(self, now: int) -> bool:
        """Return whether a newcomer may join, which counts then.

        Args:
            now: Time, nanoseconds.
        """
        if not self.has_room(now):
            return False
        if self._is_over(now):
            self._start, self._joined = now, 0
        self._joined += 1
        return True

    def has_room(self, now: int) -> bool:
        """Return whether a newcomer may join, see `admits`."""
        return (0 if self._is_over(now) else self._joined) < self._most

    def _is_over(self, now: int) -> bool:
        """Return whether the period is over, or the clock has gone back."""
        return not 0 <= now - self._start < self._period


class Membership:
    """Decides which newcomers join, so that a flood of fresh names costs the others nothing.

    Args:
        members: Agents that take part already.
        period: Time between rounds, nanoseconds; only a few newcomers join in each.
        known: Agents that may join, such as those with a key; None for any agent, up to a limit.
        strangers: Number of members that joined without being known.
    """

    def __init__(
        self,
        members: Iterable[str],
        period: int,
        known: Container[str] | None = None,
        strangers: int = 0,
    ) -> None:
        self._members, self._known, self._strangers = set(members), known, strangers
        self._limit = NewcomerLimit(_NEWCOMERS, period)

    def __contains__(self, name: object) -> bool:
        """Return whether an agent takes part."""
        return name in self._members

    def admits(self, name: str, now: int) -> bool:
        """Return whether an agent takes part, as a member or, from now on, as a newcomer.

        Args:
            name: Name of the agent.
            now: Time, nanoseconds.
        """
        if name in self._members:
            return True
        if self._strangers >= MAX_STRANGERS if self._known is None else name not in self._known:
            return False
        if not self._limit.admits(now):
            return False
        self._strangers += self._known is None
        self._members.add(name)
        return True


class Admission:
    """Accepts valid messages. Refused ones are counted and change nothing else.

    The stamps of a sender must increase, so a message that is sent twice counts once. Cheap checks
    come first: the signatures of messages that come too often are not even verified. Where the last
    stamp of a sender is a minute or more in the future, the clock has gone back since. Without keys
    its stamps then begin anew. With keys its messages are refused until the clock has caught up,
    since they could be those that it sent at that time before.

    Args:
        limits: Limits on the stamps.
        keyring: Senders that may send; None accepts every sender, without a signature.
        last_stamps: Last accepted stamp of each sender, from an earlier run.
        membership: Decides which newcomers may send; None for all.
        members: Senders that are known without keys before they have sent a valid message.

    Attributes:
        refusals: Number of refusals by sender and reason. Unknown senders are counted under `""`.
    """

    def __init__(
        self,
        limits: StampLimits,
        keyring: Keyring | None = None,
        last_stamps: dict[str, int] | None = None,
        membership: Membership | None = None,
        members: Container[str] = (),
    ) -> None:
        self._limits, self._keyring = limits, keyring
        self._last = {name: LastStamp(stamp) for name, stamp in (last_stamps or {}).items()}
        self._membership, self._members = membership, members
        self._counting = Lock()
        self.refusals: Counter[tuple[str, RefusalReason]] = Counter()

    @property
    def last_stamps(self) -> dict[str, int]:
        """Last accepted stamp of each sender, nanoseconds."""
        return {name: last.stamp for name, last in self._last.items()}

    @property
    def last(self) -> dict[str, LastStamp]:
        """Last accepted stamp of each sender, with its nonces."""
        return dict(self._last)

    def refuse(self, sender: str, reason: RefusalReason, count: int = 1) -> None:
        """Count a refusal, such as that of a message that cannot be read."""
        keyless = sender in self._last or sender in self._members
        known = keyless if self._keyring is None else sender in self._keyring
        with self._counting:
            named = (sender, reason) in self.refusals or len(self.refusals) < _REMEMBERED
            self.refusals[sender if known and named else "", reason] += count

    def accepts(self, envelope: Envelope, now: int) -> bool:
        """Return whether a message is valid; a refusal is counted.

        Args:
            envelope: Origin of the message.
            now: Time of arrival, nanoseconds.
        """
        if reason := self.error(envelope, now):
            self.refuse(envelope.sender, reason)
            return False
        self.remember(envelope)
        return True

    def is_new(self, envelope: Envelope) -> bool:
        """Return whether a message is later than the last one of its sender, or has the same stamp
        and another nonce.
        """
        return following(self._last.get(envelope.sender), envelope) is not None

    def remember(self, envelope: Envelope) -> None:
        """Remember the stamp of a message."""
        before = self._last.get(envelope.sender)
        after = following(before, envelope) or LastStamp(envelope.stamp)  # a clock has gone back
        self.remember_last(envelope.sender, after)

    def remember_last(self, sender: str, last: LastStamp) -> None:
        """Remember the last stamp of a sender."""
        self._last.pop(sender, None)
        self._last[sender] = last  # the newest last
        if self._keyring is None and len(self._last) > _REMEMBERED:
            del self._last[next(iter(self._last))]

    def admit(self, report: RatingMessage, providers: Container[str], now: int) -> Verdict:
        """Return which ratings of a report count. What is refused is counted.

        A report is refused as a whole if its rater or its time is in doubt. Otherwise each rating
        is checked on its own.

        Args:
            report: Ratings of a rater.
            providers: Names of the known providers.
            now: Time of arrival, nanoseconds.
        """
        rater, ratings = report.envelope.sender, dict[str, float]()
        if reason := self.error(report.envelope, now):
            self.refuse(rater, reason)
            return Verdict(reason, ratings)
        self.remember(report.envelope)
        for provider, value in zip(report.providers, report.values, strict=True):
            if error := rating_error(rater, provider, value, providers, ratings):
                self.refuse(rater, error)
            else:
                ratings[provider] = float(value)
        return Verdict(None, ratings)

    def error(self, envelope: Envelope, now: int) -> RefusalReason | None:
        """Return the reason why a message is refused; None if it is valid. Nothing is counted or
        remembered.

        Args:
            envelope: Origin of the message.
            now: Time of arrival, nanoseconds.
        """
        if self._keyring is not None and envelope.sender not in self._keyring:
            return RefusalReason.UNKNOWN
        if reason := self.stamp_error(envelope, now):
            return reason
        if self._keyring is not None and not envelope.signature:
            return RefusalReason.UNSIGNED
        if not is_genuine(envelope, self._keyring):
            return RefusalReason.MIS_SIGNED
        if self._membership is not None and not self._membership.admits(envelope.sender, now):
            return RefusalReason.CROWDED
        return None

    def stamp_error(self, envelope: Envelope, now: int) -> RefusalReason | None:
        """Return the reason why the stamp of a message is refused, see `error`."""
        limits, last = self._limits, self._last.get(envelope.sender)
        if envelope.stamp > now + limits.tolerance:
            return RefusalReason.FUTURE
        if envelope.stamp < now - limits.tolerance:
            return RefusalReason.PAST
        if last is not None and last.stamp > now + limits.set_back:
            return None if self._keyring is None else RefusalReason.CLOCK
        if self.is_new(envelope):
            is_soon = last is not None and last.stamp < envelope.stamp < last.stamp + limits.min_gap
            return RefusalReason.TOO_SOON if is_soon else None
        return RefusalReason.REPLAYED


def rating_error(
    rater: str,
    provider: str,
    value: float,
    providers: Container[str],
    before: Container[str],
    scale: tuple[float, float] = (0.0, 1.0),
) -> RefusalReason | None:
    """Return the reason why a rating is refused; None if it is valid.

    Args:
        rater: Name of the rater.
        provider: Name of the rated provider.
        value: Rating.
        providers: Names of the known providers.
        before: Names of the providers that the same message has rated before.
        scale: Worst and best rating.
    """
    if provider == rater:
        return RefusalReason.ITSELF
    if provider not in providers:
        return RefusalReason.UNKNOWN_PROVIDER
    if provider in before:
        return RefusalReason.DOUBLED
    if math.isnan(value):
        return RefusalReason.NOT_A_NUMBER
    return None if scale[0] <= value <= scale[1] else RefusalReason.OUT_OF_RANGE
