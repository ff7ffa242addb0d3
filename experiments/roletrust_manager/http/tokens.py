"""Tokens of agents: registrations, ratings and farewells as signed JSON Web Tokens (RFC 7519), and
the proof of work.

Both sides use it. Agents in other languages need a library for such tokens with EdDSA (RFC 8037),
and SHA-256.
"""

import base64
from hashlib import sha256
from typing import Annotated, Any, Literal, TypeVar

import jwt
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from roletrust_env.errors import short, validation_message
from roletrust_env.storage.untrusted import parse_json
from roletrust_manager.admission.keys import NAME
from roletrust_manager.admission.validation import Envelope

MAX_TOKEN = 4096
"""Number of characters that a token may have."""

_ALGORITHM = "EdDSA"

Name = Annotated[str, Field(pattern=f"^{NAME}$", examples=["ann"])]
"""Name of an agent or of a manager: up to 200 letters, digits and `_.-@:+`, the first a letter or
`_`."""

Key = Annotated[str, Field(pattern="^[-_A-Za-z0-9]{43}$")]
"""Public key, ed25519: 32 bytes in base64url without padding, as `x` of a JSON Web Key (RFC
8037)."""

_Signature = Annotated[str, Field(pattern="^[-_A-Za-z0-9]{86}$")]
_Time = Annotated[float, Field(allow_inf_nan=False)]


def _single_audience(aud: Any) -> Any:
    """Return the only element of an array with one element, and any other value unchanged."""
    return aud[0] if isinstance(aud, list) and len(aud) == 1 else aud


class Claims(BaseModel):
    """Claims of a token, shared by all kinds. Further claims are allowed, and stand in the journal
    with the token.

    Attributes:
        kind: Kind of the token, so that none can be sent as another.
        iss: Name of the agent that signs it.
        aud: Name of the manager that it is for. A token may have it as an array with one name.
        iat: Time of signing, seconds since 1970, to the microsecond. It increases from token to
            token of an agent.
        exp: Time at which the token expires, seconds since 1970; None for a token that does not.
        nbf: Time from which the token is valid, seconds since 1970; None for a token that is always
            valid before `exp`.
        jti: Identifier of the token, by which tokens of the same `iat` differ, such as one in whole
            seconds.
    """

    model_config = ConfigDict(strict=True, frozen=True)

    kind: str
    iss: Name
    aud: Annotated[Name, BeforeValidator(_single_audience)]
    iat: Annotated[float, Field(gt=0, lt=1e10, allow_inf_nan=False)]
    exp: _Time | None = None
    nbf: _Time | None = None
    jti: Annotated[str, Field(min_length=1, max_length=64)] | None = None

    @property
    def stamp(self) -> int:
        """Time of signing, nanoseconds since 1970."""
        return round(self.iat * 1e6) * 1000


class Registration(Claims):
    """Claims of an agent that registers.

    Attributes:
        key: Public key of the agent.
        work: Nonce that proves the work, see `has_work`.
        recovery: Public key of the owner of the agent, without whose signature its key cannot be
            replaced; None for no such key. That of the first registration counts.
    """

    kind: Literal["register"] = "register"
    key: Key
    recovery: Key | None = None
    work: Annotated[int, Field(ge=0, lt=2**63)] = 0


class Rating(Claims):
    """Claims of a rating.

    Attributes:
        sub: Name of the provider.
        rating: Rating, on the scale of the manager.
    """

    kind: Literal["rating"] = "rating"
    sub: Name
    rating: Annotated[float, Field(allow_inf_nan=False)]


class Rotation(Claims):
    """Claims of an agent that replaces its key. The token is signed with the old one.

    Attributes:
        key: New public key of the agent.
        proof: Signature with the new key, see `with_proofs`, so that nobody can claim the key of
            another.
        recovered: Signature with the recovery key; None without such a key.
    """

    kind: Literal["rotate"] = "rotate"
    key: Key
    proof: _Signature = "-" * 86
    recovered: _Signature | None = None


class Leave(Claims):
    """Claims of an agent that leaves."""

    kind: Literal["leave"] = "leave"


AnyClaims = TypeVar("AnyClaims", bound=Claims)


def sign_token(claims: Claims, key: Ed25519PrivateKey) -> str:
    """Return the token of some claims, signed by the private key of their agent."""
    token: str = jwt.encode(claims.model_dump(exclude_none=True), key, algorithm=_ALGORITHM)
    return token


def read_token(token: str, kind: type[AnyClaims]) -> tuple[AnyClaims, Envelope]:
    """Return the claims of a token of some kind, and its origin.

    It checks the form only, neither the signature nor the times. The three parts must be canonical
    base64url without padding, so that a token has one spelling.

    Raises:
        ValueError: The text is not such a token, or its claims are not those of the kind.
    """
    if len(token) > MAX_TOKEN:
        raise ValueError(f"a token has up to {MAX_TOKEN:,} characters, this one has {len(token):,}")
    parts = token.split(".")
    if len(parts) != 3:
        raise ValueError(f"a signed JSON Web Token has three parts, this one has {len(parts)}")
    head, payload, signature = map(_decoded, parts)
    header = parse_json(head)
    if not isinstance(header, dict) or header.get("alg") != _ALGORITHM or "crit" in header:
        raise ValueError(f"a token has the algorithm {_ALGORITHM}, and no critical extensions")
    said, wanted = parse_json(payload), kind.model_fields["kind"].default
    if not isinstance(said, dict) or said.get("kind") != wanted:
        found = said.get("kind") if isinstance(said, dict) else said
        raise ValueError(f"the kind of the token is {short(repr(found))}; it must be {wanted}")
    try:
        claims = kind.model_validate_json(payload)
    except ValidationError as error:
        raise ValueError(
            f"the token has other claims than a {kind.__name__.lower()}: "
            f"{validation_message(error)}"
        ) from None
    signed = token.rpartition(".")[0].encode()
    return claims, Envelope(claims.iss, claims.stamp, signed, signature, claims.jti or "")


def _decoded(part: str) -> bytes:
    """Return the bytes of a part of a token.

    Raises:
        ValueError: It is not the one base64url text of some bytes, without padding.
    """
    try:
        content = base64.urlsafe_b64decode(part + "=" * (-len(part) % 4))
    except ValueError:
        content = b""
    if _base64url(content) != part:
        raise ValueError(
            "each part of a token must be canonical base64url without padding, got "
            f"{short(repr(part))}"
        )
    return content


def _base64url(content: bytes) -> str:
    """Return bytes in base64url without padding."""
    return base64.urlsafe_b64encode(content).decode().rstrip("=")


def key_as_text(key: Ed25519PublicKey) -> str:
    """Return a public key as the text of `Registration.key`."""
    return _base64url(key.public_bytes_raw())


def key_of_text(text: str) -> Ed25519PublicKey:
    """Return the public key of `Registration.key`.

    Raises:
        ValueError: It is not the text of 32 bytes.
    """
    return Ed25519PublicKey.from_public_bytes(base64.urlsafe_b64decode(f"{text}="))


def has_work(claims: Registration, bits: int) -> bool:
    """Return whether a registration proves the work that a manager asks for.

    The SHA-256 of `aud`, `iss`, `key`, `iat` in whole microseconds, and `work`, joined by newlines,
    begins with `bits` zeros. `iat` makes each return of an agent cost as much as its first
    registration, and lets work expire (Back, "Hashcash: A Denial of Service Counter-Measure",
    2002). Who knows when it will register can work ahead.

    Args:
        claims: Claims of the registration.
        bits: Number of zero bits, 0 for no work.
    """
    return _proves(_statement(claims) + str(claims.work).encode(), bits)


def with_work(claims: Registration, bits: int) -> Registration:
    """Return a registration with the nonce that proves the work; it takes about 2^bits hashes, a
    second for 20.
    """
    puzzle, nonce = _statement(claims), 0
    while not _proves(puzzle + str(nonce).encode(), bits):
        nonce += 1
    return claims.model_copy(update={"work": nonce})


def with_proofs(
    claims: Rotation, key: Ed25519PrivateKey, recovery: Ed25519PrivateKey | None = None
) -> Rotation:
    """Return a rotation with the signatures of its `aud`, `iss`, `key`, and `iat` in whole
    microseconds, each ended by a newline.

    Args:
        claims: Claims of the rotation.
        key: New key of the agent.
        recovery: Recovery key, if one is registered.
    """
    statement = _statement(claims)
    proofs = {"proof": _base64url(key.sign(statement))}
    if recovery is not None:
        proofs["recovered"] = _base64url(recovery.sign(statement))
    return claims.model_copy(update=proofs)


def has_proofs(claims: Rotation, recovery: Ed25519PublicKey | None) -> bool:
    """Return whether a rotation is signed with the new key, and with a recovery key if there is
    one.
    """
    try:
        key_of_text(claims.key).verify(_decoded(claims.proof), _statement(claims))
        if recovery is not None:
            recovery.verify(_decoded(claims.recovered or ""), _statement(claims))
    except (InvalidSignature, ValueError):
        return False
    return True


def _statement(claims: Registration | Rotation) -> bytes:
    """Return what is said about a key."""
    return f"{claims.aud}\n{claims.iss}\n{claims.key}\n{claims.stamp // 1000}\n".encode()


def _proves(text: bytes, bits: int) -> bool:
    return int.from_bytes(sha256(text).digest()) >> (256 - bits) == 0
