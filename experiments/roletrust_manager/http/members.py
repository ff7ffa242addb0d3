"""The members of a trust manager: who has registered, with which key, and what each sent last."""

import json
from base64 import urlsafe_b64decode
from collections import Counter
from collections.abc import Sequence
from hashlib import sha256
from typing import Any, TypeVar

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from pydantic import NonNegativeInt

from roletrust_env.storage.untrusted import UntrustedModel
from roletrust_manager.admission.keys import KnownKeys
from roletrust_manager.admission.validation import (
    Admission,
    Envelope,
    LastStamp,
    NewcomerLimit,
    StampLimits,
)
from roletrust_manager.http.requests import (
    MICROSECONDS,
    LastRequest,
    Member,
    Receipt,
    Settings,
)
from roletrust_manager.http.tokens import (
    Registration,
    Rotation,
    key_as_text,
    key_of_text,
    read_token,
)
from roletrust_manager.journal.sql import Event

_KeyClaims = TypeVar("_KeyClaims", Registration, Rotation)
_AGAIN = "~"  # between the name of an agent that has come back, and how often it has begun


class StoredMembers(UntrustedModel):
    """All that `Members` keep, for a file."""

    members: list[tuple[str, str, str, int, float]]
    keys: dict[str, str]
    recovery: dict[str, str]
    begun: dict[str, NonNegativeInt]
    latest: dict[str, LastRequest]
    stamps: dict[str, int]
    nonces: dict[str, tuple[str, ...]]
    newcomers: tuple[int, int]


class Members:
    """The agents that have registered.

    Args:
        settings: Settings of the manager.
        manager: Its name.

    Attributes:
        begun: Number of agents that have ever been there; who comes back is another one.
        keys: Key of each name that was ever registered.
        recovery: Recovery key of each name that has one.
        by_name: Registered agents.
        latest: Last request of each agent.
        admission: Checks when and by whom tokens were signed.
        limit: Limits the newcomers of a round.
    """

    def __init__(self, settings: Settings, manager: str) -> None:
        self._manager, self.begun = manager, 0
        self.keys: dict[str, Ed25519PublicKey] = {}
        self.by_name: dict[str, Member] = {}
        self.latest: dict[str, LastRequest] = {}
        self._begun: Counter[str] = Counter()  # how often each agent has registered
        self.recovery: dict[str, Ed25519PublicKey] = {}
        limits = StampLimits(round(settings.tolerance * 1e9), 1)
        self.admission = Admission(limits, KnownKeys(self.keys))
        self.limit = NewcomerLimit(settings.newcomers, round(settings.every * 1e9))

    def next_identity(self, name: str) -> str:
        """Return the identity that an agent gets if it registers now."""
        number = self._begun[name] + 1
        return name if number == 1 else f"{name}{_AGAIN}{number}"

    def fits(self, event: Event) -> dict[str, Any] | None:
        """Return the claims of an event; None if its agent cannot have sent it now, or its token
        says something else.
        """
        name, claims = name_of(event.sender), _claims(event.token)
        member, audience = self.by_name.get(name), claims.get("aud")
        said = (
            claims.get("kind"),
            claims.get("iss"),
            audience[0] if isinstance(audience, list) and audience else audience,
            _stamp(claims.get("iat")),
        )
        if said != (event.kind, name, self._manager, event.stamp):
            return None
        if not self.admission.is_new(_envelope(event, claims)):
            return None
        if event.kind != "rating" and (event.provider, event.rating) != (None, None):
            return None
        if event.kind == "register":
            key = _read(event, Registration)
            known = key is not None and self.keys.get(name, key[1]) == key[1]
            joins = member is None and known and event.sender == self.next_identity(name)
            return claims if joins else None
        if member is None or member.identity != event.sender:
            return None
        if event.kind != "rating":
            return claims if event.kind == "leave" or _read(event, Rotation) else None
        provider, rating = claims.get("sub"), claims.get("rating")
        rated = self.by_name.get(provider) if isinstance(provider, str) else None
        if rated is None or rated == member or rated.identity != event.provider:
            return None
        is_said = isinstance(rating, int | float) and float(rating) == event.rating
        return claims if is_said else None

    def follow(self, event: Event, claims: dict[str, Any]) -> None:
        """Take an event into account, which fits, with its claims."""
        name = name_of(event.sender)
        self.admission.remember(_envelope(event, claims))
        before = self.latest.get(name)
        if before is None or before.time != event.time:
            before = LastRequest(event.seq, 0, event.time, "")
        digest = digest_of([event.token], before.digest)
        self.latest[name] = before._replace(size=before.size + 1, digest=digest)
        if event.kind == "rating":
            return
        if event.kind == "leave":
            del self.by_name[name]
        elif (found := _read(event, Rotation)) is not None:
            self.by_name[name] = self.by_name[name]._replace(key=found[0].key)
            self.keys[name] = found[1]
        elif (joined := _read(event, Registration)) is not None:
            registration, key = joined
            if name not in self.keys and registration.recovery is not None:
                self.recovery[name] = key_of_text(registration.recovery)
            self.keys[name] = key
            self._begun[name] += 1
            self.begun += 1
            receipt = Receipt(event.seq, event.time / MICROSECONDS)
            self.by_name[name] = Member(name, event.sender, registration.key, receipt)
            self.limit.admits(event.time * 1000)

    def save(self) -> StoredMembers:
        """Return all that is kept."""
        last = self.admission.last
        return StoredMembers(
            members=[(*one[:3], *one.receipt) for one in self.by_name.values()],
            keys={name: key_as_text(key) for name, key in self.keys.items()},
            recovery={name: key_as_text(key) for name, key in self.recovery.items()},
            begun=dict(self._begun),
            latest=dict(self.latest),
            stamps={name: one.stamp for name, one in last.items()},
            nonces={name: tuple(one.nonces) for name, one in last.items() if one.nonces},
            newcomers=self.limit.state,
        )

    def load(self, stored: StoredMembers) -> None:
        """Go on from what was kept.

        Raises:
            ValueError: A key is none.
        """
        self.keys |= {name: key_of_text(key) for name, key in stored.keys.items()}
        self.recovery |= {name: key_of_text(key) for name, key in stored.recovery.items()}
        self.by_name |= {
            name: Member(name, identity, key, Receipt(seq, time))
            for name, identity, key, seq, time in stored.members
        }
        self._begun.update(stored.begun)
        self.begun = self._begun.total()
        self.latest |= stored.latest
        for name, stamp in stored.stamps.items():
            self.admission.remember_last(
                name, LastStamp(stamp, frozenset(stored.nonces.get(name, ())))
            )
        self.limit.state = stored.newcomers


def name_of(identity: str) -> str:
    """Return the name of an agent, see `Member.identity`."""
    return identity.partition(_AGAIN)[0]


def digest_of(tokens: Sequence[str], digest: str = "") -> str:
    """Return the digest of the tokens of a request, after that of those before: the SHA-256 of the
    digest so far and the next token.
    """
    for token in tokens:
        digest = sha256(f"{digest}{token}".encode()).hexdigest()
    return digest


def _claims(token: str) -> dict[str, Any]:
    """Return the claims of a token that was read before; empty if it is not a token."""
    try:
        payload = token.split(".")[1]
        found = json.loads(urlsafe_b64decode(payload + "=" * (-len(payload) % 4)))
    except (ValueError, IndexError):
        return {}
    return found if isinstance(found, dict) else {}


def _envelope(event: Event, claims: dict[str, Any]) -> Envelope:
    nonce = claims.get("jti")
    nonce = nonce if isinstance(nonce, str) else ""
    return Envelope(name_of(event.sender), event.stamp, nonce=nonce)


def _read(event: Event, kind: type[_KeyClaims]) -> tuple[_KeyClaims, Ed25519PublicKey] | None:
    """Return the claims and the key of an event of a kind; None if it is of another, or damaged."""
    if event.kind != kind.model_fields["kind"].default:
        return None
    try:
        claims, _ = read_token(event.token, kind)
        return claims, key_of_text(claims.key)
    except ValueError:
        return None


def _stamp(iat: object) -> int:
    return round(iat * 1e6) * 1000 if isinstance(iat, int | float) else -1
