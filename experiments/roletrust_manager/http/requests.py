"""Requests to a trust manager, their receipts and their refusals, and its settings."""

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from pydantic import Field, FiniteFloat, NonNegativeInt, PositiveInt, ValidationError

from roletrust_env.errors import validation_message
from roletrust_env.parameters import checked_dataclass
from roletrust_manager.admission.keys import is_forgeable
from roletrust_manager.admission.validation import Envelope, RefusalReason
from roletrust_manager.http.tokens import (
    Claims,
    Registration,
    Rotation,
    key_as_text,
    key_of_text,
)

MICROSECONDS = 1_000_000
"""Microseconds of a second, in which the journal has times."""

_WHY = {
    RefusalReason.ELSEWHERE: "the token of {} is not for this place",
    RefusalReason.UNKNOWN: "{} is not registered here",
    RefusalReason.FUTURE: "the token of {} was signed in the future",
    RefusalReason.PAST: "the token of {} was signed too long ago, so sign it anew",
    RefusalReason.CLOCK: "the clock here has gone back since the last token of {}, so try again later",  # noqa: E501
    RefusalReason.REPLAYED: "a token of {} that was signed at this time or later has come before, so sign it anew",  # noqa: E501
    RefusalReason.UNSIGNED: "the token of {} has no signature",
    RefusalReason.MIS_SIGNED: "the token was not signed with the key of {}",
    RefusalReason.NO_WORK: "the registration of {} lacks its proof of work",
    RefusalReason.TAKEN: "the name {} belongs to another key",
    RefusalReason.CROWDED: "{} comes with too many other newcomers, so try again later",
    RefusalReason.FLOOD: "{} has rated too often, so try again in the next round",
    RefusalReason.UNKNOWN_PROVIDER: "{} rates an agent that is not registered here",
    RefusalReason.ITSELF: "{} rates itself",
    RefusalReason.DOUBLED: "{} rates an agent twice in a request",
    RefusalReason.NOT_A_NUMBER: "the rating of {} is no number",
    RefusalReason.OUT_OF_RANGE: "the rating of {} is off the scale",
}


class Signed(NamedTuple):
    """A token that has been read.

    Attributes:
        token: Token as it came.
        claims: Its claims.
        envelope: Its origin.
    """

    token: str
    claims: Any
    envelope: Envelope


@checked_dataclass
class Settings:
    """Settings of a manager.

    Attributes:
        every: Length of a round, seconds, from 1 to 10**9.
        scale: Worst and best rating, two finite numbers.
        same_agents: Whether the rater and the provider of a name are one agent.
        work: Zero bits of the proof of work of a newcomer, from 0 to 64, see `has_work`.
        quota: Number of ratings that an agent may send in a round, 1 or more.
        newcomers: Number of agents that may register in a round, 0 or more.
        tolerance: Largest difference between the time of signing and the clock, seconds, from 0 to
            10**9.

    Raises:
        ValueError: A setting is not allowed.
    """

    every: Annotated[float, Field(ge=1, le=1e9)] = 60.0
    scale: tuple[FiniteFloat, FiniteFloat] = (0.0, 1.0)
    same_agents: bool = True
    work: Annotated[int, Field(ge=0, le=64)] = 16
    quota: PositiveInt = 1000
    newcomers: NonNegativeInt = 100
    tolerance: Annotated[float, Field(ge=0, le=1e9)] = 60.0


def make_settings(**settings: Any) -> Settings:
    """Return the settings of a manager from keyword arguments, see `Settings`.

    Raises:
        ValueError: A setting is not allowed; the message is one line.
    """
    try:
        return Settings(**settings)
    except ValidationError as error:
        raise ValueError(validation_message(error)) from None


class Request(NamedTuple):
    """Tokens of one kind, which count as a whole.

    Attributes:
        kind: Kind of the claims.
        tokens: Tokens, at least one.
        name: Agent that the request is about; None for the one that the tokens name.
    """

    kind: type[Claims]
    tokens: Sequence[str]
    name: str | None = None


class Checked(NamedTuple):
    """A request whose tokens are valid, as far as that does not depend on requests before it.

    Attributes:
        name: Agent that has signed them.
        digest: Digest of them, see `digest_of`.
        key: Key with which they were signed; None for a registration.
        signed: The tokens; none if they are the last request of the agent, sent again.
    """

    name: str
    digest: str
    key: Ed25519PublicKey | None = None
    signed: tuple[Signed, ...] = ()


class Receipt(NamedTuple):
    """Acknowledgement of a token.

    Attributes:
        seq: Number of its event in the journal.
        time: Time of arrival, seconds.
    """

    seq: int
    time: float


class LastRequest(NamedTuple):
    """The last request of an agent, which may be sent again.

    Attributes:
        first: Number of its first event.
        size: Number of its events.
        time: Time of arrival, microseconds.
        digest: Digest of its tokens, see `digest_of`.
    """

    first: int
    size: int
    time: int
    digest: str

    @property
    def receipts(self) -> list[Receipt]:
        """Acknowledgements of its tokens."""
        return [Receipt(self.first + n, self.time / MICROSECONDS) for n in range(self.size)]


class RefusedError(Exception):
    """A request that does not count.

    Attributes:
        reason: Reason.
        detail: What is wrong, and what would be right, in a sentence.
        at: Place of the token in the request.
        sender: Agent that the token names; empty if it names none.
    """

    def __init__(self, reason: RefusalReason, detail: str, at: int = 0, sender: str = "") -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason, self.detail, self.at, self.sender = reason, detail, at, sender


class Member(NamedTuple):
    """A registered agent.

    Attributes:
        name: Name.
        identity: Name in the journal: who comes back is another agent there, such as `ann~2`.
        key: Public key, see `Registration.key`.
        receipt: Acknowledgement of the registration.
    """

    name: str
    identity: str
    key: str
    receipt: Receipt


def refusal(reason: RefusalReason, claims: Claims, at: int, hint: str) -> RefusedError:
    """Return the refusal of a token of a request, with a hint what would be right."""
    return RefusedError(reason, f"{_WHY[reason].format(claims.iss)}; {hint}", at, claims.iss)


def registered_key(claims: Registration | Rotation) -> Ed25519PublicKey:
    """Return the key of a registration or of a rotation.

    Raises:
        RefusedError: Anybody could sign with it, or it is written in another way than `key_as_text`
            does.
    """
    key = key_of_text(claims.key)
    if is_forgeable(key) or key_as_text(key) != claims.key:
        raise RefusedError(
            RefusalReason.GARBAGE,
            "the key is of small order, or not as RFC 8037 has it",
            0,
            claims.iss,
        )
    return key
