"""Validation of incoming ratings: which of them may reach the trust model, and why the others are refused."""

import math
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple, Protocol


class Ratings(NamedTuple):
    """A message with a rater's ratings of the services of one round.

    Attributes:
        rater: Name of the rater, as the message gives it.
        stamp: Time stamp of the services, nanoseconds.
        providers: Names of the rated providers.
        values: Ratings, in the order of the providers.
        signed: Bytes that the signature covers.
        signature: Signature; empty if there is none.
    """

    rater: str
    stamp: int
    providers: Sequence[str]
    values: Sequence[float]
    signed: bytes = b""
    signature: bytes = b""


class RefusalReason(StrEnum):
    """Reason for a refusal. The reasons down to `MIS_SIGNED` concern a whole message, the others a single rating."""

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
    """The known raters and a check of their signatures."""

    def __contains__(self, rater: object) -> bool:
        """Return whether a rater of that name is known."""
        ...

    def verifies(self, rater: str, signed: bytes, signature: bytes) -> bool:
        """Return whether a signature of some bytes is that of a known rater."""
        ...


@dataclass(frozen=True)
class StampLimits:
    """Limits on the time stamps of ratings.

    Attributes:
        tolerance: Largest difference between a stamp and the time of arrival, nanoseconds.
        min_gap: Smallest difference between two stamps of one rater, nanoseconds; for example half a period. It limits
            the share of the rounds, and of the manager's time, that one rater can take.
    """

    tolerance: int
    min_gap: int


class RatingValidator:
    """Accepts valid ratings. Refused ratings are counted and change nothing else.

    A message is refused as a whole if its rater or its time is in doubt. Otherwise each rating is checked on its own.
    The stamps of a rater must increase, so a message that is sent twice counts once. Cheap checks come first: the
    signatures of messages that come too often are not even verified.

    Args:
        limits: Limits on the stamps.
        keyring: Raters that may rate; None accepts every rater, without a signature.
        last_stamps: Last accepted stamp of each rater, from an earlier run.

    Attributes:
        refusals: Number of refusals by rater and reason. Unknown raters are counted under `""`.
    """

    def __init__(
        self, limits: StampLimits, keyring: Keyring | None = None, last_stamps: dict[str, int] | None = None
    ) -> None:
        self._limits, self._keyring, self._last_stamps = limits, keyring, dict(last_stamps or {})
        self.refusals: Counter[tuple[str, RefusalReason]] = Counter()

    def refuse(self, rater: str, reason: RefusalReason, count: int = 1) -> None:
        """Count a refusal, such as that of a message that cannot be read."""
        known = rater in self._last_stamps if self._keyring is None else rater in self._keyring
        self.refusals[rater if known else "", reason] += count

    def accept(self, ratings: Ratings, providers: Collection[str], now: int) -> dict[str, float]:
        """Return the valid ratings of a message, by provider; none if the message is refused.

        Args:
            ratings: Message.
            providers: Names of the known providers.
            now: Time of arrival, nanoseconds.
        """
        if reason := self._message_error(ratings, now):
            self.refuse(ratings.rater, reason)
            return {}
        self._last_stamps[ratings.rater] = ratings.stamp
        accepted: dict[str, float] = {}
        for provider, value in zip(ratings.providers, ratings.values, strict=True):
            if reason := _rating_error(ratings.rater, provider, value, providers, accepted):
                self.refuse(ratings.rater, reason)
            else:
                accepted[provider] = float(value)
        return accepted

    def _message_error(self, ratings: Ratings, now: int) -> RefusalReason | None:
        limits, last = self._limits, self._last_stamps.get(ratings.rater)
        if len(ratings.providers) != len(ratings.values):
            return RefusalReason.GARBAGE
        if self._keyring is not None and ratings.rater not in self._keyring:
            return RefusalReason.UNKNOWN_RATER
        if ratings.stamp > now + limits.tolerance:
            return RefusalReason.FUTURE
        if ratings.stamp < now - limits.tolerance:
            return RefusalReason.PAST
        if last is not None and ratings.stamp < last + limits.min_gap:
            return RefusalReason.TOO_SOON if ratings.stamp > last else RefusalReason.REPLAYED
        if self._keyring is None:
            return None
        if not ratings.signature:
            return RefusalReason.UNSIGNED
        valid = self._keyring.verifies(ratings.rater, ratings.signed, ratings.signature)
        return None if valid else RefusalReason.MIS_SIGNED


def _rating_error(
    rater: str, provider: str, value: float, providers: Collection[str], before: Collection[str]
) -> RefusalReason | None:
    if provider not in providers:
        return RefusalReason.UNKNOWN_PROVIDER
    if provider == rater:
        return RefusalReason.ITSELF
    if provider in before:
        return RefusalReason.DOUBLED
    if math.isnan(value):
        return RefusalReason.NOT_A_NUMBER
    return None if 0 <= value <= 1 else RefusalReason.OUT_OF_RANGE
