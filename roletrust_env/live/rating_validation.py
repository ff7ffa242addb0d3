"""Which of the ratings that arrive may reach the trust model, and why the others may not."""

import math
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple, Protocol


class Ratings(NamedTuple):
    """What a rater says of the services of one round.

    Attributes:
        rater: who says it, by its own account.
        stamp: of the services, nanoseconds.
        providers: whom it rates.
        values: its ratings, in the same order.
        signed: the bytes that the signature is of.
        signature: empty if there is none.
    """

    rater: str
    stamp: int
    providers: Sequence[str]
    values: Sequence[float]
    signed: bytes = b""
    signature: bytes = b""


class Reason(StrEnum):
    """Why something was refused: of a whole message down to its signature, of single ratings from there on."""

    FLOOD = "too many messages"
    GARBAGE = "garbage"
    ELSEWHERE = "on the topic of another"
    UNKNOWN_RATER = "unknown rater"
    FUTURE = "stamp from the future"
    PAST = "stamp from the past"
    REPLAYED = "replayed"
    TOO_SOON = "too soon after the last"
    UNSIGNED = "unsigned"
    MIS_SIGNED = "mis-signed"
    UNKNOWN_PROVIDER = "unknown provider"
    ITSELF = "rates itself"
    DOUBLED = "doubled"
    NOT_A_NUMBER = "not a number"
    OUT_OF_RANGE = "out of range"


class Keyring(Protocol):
    """The raters that are known, and their signatures."""

    def __contains__(self, rater: object) -> bool:
        """Whether a rater of that name is known."""
        ...

    def verifies(self, rater: str, signed: bytes, signature: bytes) -> bool:
        """Whether a signature is that of a rater, who is known."""
        ...


@dataclass(frozen=True)
class Clock:
    """What stamps must be like.

    Attributes:
        tolerance: how far a stamp may be from the time of its arrival, nanoseconds.
        least: what lies between two stamps of a rater at least, nanoseconds; half a period, say. So no rater has more
            than its share of the rounds, nor of the manager's time.
    """

    tolerance: int
    least: int


class Gate:
    """Lets the ratings through that may count. What is refused is counted, and moves nothing.

    A message is refused as a whole if it is not known whose it is or when it was made, and looked at rating by rating
    otherwise. Stamps of a rater rise, so that what was sent once counts once. What costs least is looked at first:
    signatures of messages that come too often are not even verified.

    Args:
        clock: what stamps must be like.
        keyring: who may rate; None lets everybody, without a signature.
        since: the last stamp of each rater that counted before.

    Attributes:
        refused: how often, by rater and reason. Names that are not known are counted under `""`.
    """

    def __init__(self, clock: Clock, keyring: Keyring | None = None, since: dict[str, int] | None = None) -> None:
        self._clock, self._keyring, self._last = clock, keyring, dict(since or {})
        self.refused: Counter[tuple[str, Reason]] = Counter()

    def refuse(self, rater: str, reason: Reason, count: int = 1) -> None:
        """Count something that is refused, such as a message that cannot be read."""
        known = rater in self._last if self._keyring is None else rater in self._keyring
        self.refused[rater if known else "", reason] += count

    def admit(self, ratings: Ratings, providers: Collection[str], now: int) -> dict[str, float]:
        """The ratings of a message that may count, by provider; none of a message that is refused.

        Args:
            ratings: the message.
            providers: those that are known.
            now: the time of its arrival, nanoseconds.
        """
        if reason := self._trouble(ratings, now):
            self.refuse(ratings.rater, reason)
            return {}
        self._last[ratings.rater] = ratings.stamp
        admitted: dict[str, float] = {}
        for provider, value in zip(ratings.providers, ratings.values, strict=True):
            if reason := _wrong(ratings.rater, provider, value, providers, admitted):
                self.refuse(ratings.rater, reason)
            else:
                admitted[provider] = float(value)
        return admitted

    def _trouble(self, ratings: Ratings, now: int) -> Reason | None:
        """What is wrong with a message as a whole."""
        clock, last = self._clock, self._last.get(ratings.rater)
        if len(ratings.providers) != len(ratings.values):
            return Reason.GARBAGE
        if self._keyring is not None and ratings.rater not in self._keyring:
            return Reason.UNKNOWN_RATER
        if ratings.stamp > now + clock.tolerance:
            return Reason.FUTURE
        if ratings.stamp < now - clock.tolerance:
            return Reason.PAST
        if last is not None and ratings.stamp < last + clock.least:
            return Reason.TOO_SOON if ratings.stamp > last else Reason.REPLAYED
        if self._keyring is None:
            return None
        if not ratings.signature:
            return Reason.UNSIGNED
        signed = self._keyring.verifies(ratings.rater, ratings.signed, ratings.signature)
        return None if signed else Reason.MIS_SIGNED


def _wrong(
    rater: str, provider: str, value: float, providers: Collection[str], before: Collection[str]
) -> Reason | None:
    """What is wrong with a single rating."""
    if provider not in providers:
        return Reason.UNKNOWN_PROVIDER
    if provider == rater:
        return Reason.ITSELF
    if provider in before:
        return Reason.DOUBLED
    if math.isnan(value):
        return Reason.NOT_A_NUMBER
    return None if 0 <= value <= 1 else Reason.OUT_OF_RANGE
