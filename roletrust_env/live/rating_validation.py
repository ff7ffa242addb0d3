"""Validation of incoming ratings: which of them may reach the trust model, and why the others are refused."""

import math
from collections.abc import Container, Sequence
from typing import NamedTuple

from roletrust_env.live.admission import Admission
from roletrust_env.live.message_validation import Envelope, Keyring, MessageValidator, RefusalReason, StampLimits


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


class RatingValidator(MessageValidator):
    """Accepts valid ratings. Refused ratings are counted and change nothing else.

    A message is refused as a whole if its rater or its time is in doubt. Otherwise each rating is checked on its own.

    Args:
        limits: Limits on the stamps.
        keyring: Raters that may rate; None accepts every rater, without a signature.
        last_stamps: Last accepted stamp of each rater, from an earlier run.
        admission: Decides which newcomers may rate; None for all.
    """

    def __init__(
        self,
        limits: StampLimits,
        keyring: Keyring | None = None,
        last_stamps: dict[str, int] | None = None,
        admission: Admission | None = None,
    ) -> None:
        super().__init__(limits, keyring, last_stamps)
        self._admission = admission

    def accept(self, ratings: Ratings, providers: Container[str], now: int) -> dict[str, float]:
        """Return the valid ratings of a message, by provider; none if the message is refused.

        Args:
            ratings: Message.
            providers: Names of the known providers.
            now: Time of arrival, nanoseconds.
        """
        if len(ratings.providers) != len(ratings.values):
            self.refuse(ratings.rater, RefusalReason.GARBAGE)
            return {}
        if not self.accepts(Envelope(ratings.rater, ratings.stamp, ratings.signed, ratings.signature), now):
            return {}
        accepted: dict[str, float] = {}
        for provider, value in zip(ratings.providers, ratings.values, strict=True):
            if reason := _rating_error(ratings.rater, provider, value, providers, accepted):
                self.refuse(ratings.rater, reason)
            else:
                accepted[provider] = float(value)
        return accepted

    def _error(self, envelope: Envelope, now: int) -> RefusalReason | None:
        reason = super()._error(envelope, now)
        if reason is None and self._admission is not None and not self._admission.admits(envelope.sender, now):
            return RefusalReason.CROWDED
        return reason


def _rating_error(
    rater: str, provider: str, value: float, providers: Container[str], before: Container[str]
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
