"""The members of a trust manager: who has registered, with which key, and what each sent last."""

import json
from base64 import urlsafe_b64decode
from collections import Counter
from collections.abc import Sequence
from hashlib import sha256
from typing import Any

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

    Attributes:
        keys: Key of each name that was ever registered.
        keyring: The same, as a `Keyring`.
        recovery: Recovery key of each name that has one.
        by_name: Registered agents.
        latest: Last request of each agent.
        admission: Checks when and by whom tokens were signed.
        limit: Limits the newcomers of a round.
    """

    def __init__(self, settings: Settings) -> None:
        self.keys: dict[str, Ed25519PublicKey] = {}
        self.by_name: dict[str, Member] = {}
        self.latest: dict[str, LastRequest] = {}
        self._begun: Counter[str] = Counter()  # how often each agent has registered
        self.keyring = KnownKeys(self.keys)
        self.recovery: dict[str, Ed25519PublicKey] = {}
        limits = StampLimits(round(settings.tolerance * 1e9), 1)
        self.admission = Admission(limits, self.keyring)
        self.limit = NewcomerLimit(settings.newcomers, round(settings.every * 1e9))

    @property
    def begun(self) -> int:
        """Number of agents that have ever been there; who comes back is another one."""
        return self._begun.total()

    def next_identity(self, name: str) -> str:
        """Return the identity that an agent gets if it registers now."""
        number = self._begun[name] + 1
        return name if number == 1 else f"{name}{_AGAIN}{number}"

    def follow(self, event: Event) -> bool:
        """Take an event into account; return whether its agent can have sent it then, and its token
        says the same.
        """
        name, claims = name_of(event.sender), _claims(event.token)
        member = self.by_name.get(name)
        nonce = claims.get("jti")
        envelope = Envelope(name, event.stamp, nonce=nonce if isinstance(nonce, str) else "")
        said = claims.get("kind"), claims.get("iss"), _stamp(claims.get("iat"))
        if said != (event.kind, name, event.stamp) or not self.admission.is_new(envelope):
            return False
        if event.kind == "register":
            if member is not None or not self._joins(event, name):
                return False
        elif member is None or member.identity != event.sender:
            return False
        elif event.kind == "leave":
            del self.by_name[name]
        elif event.kind == "rotate":
            try:
                rotation, _ = read_token(event.token, Rotation)
            except ValueError:
                return False
            self.keys[name] = key_of_text(rotation.key)
            self.by_name[name] = member._replace(key=rotation.key)
        else:
            provider = claims.get("sub")
            rated = self.by_name.get(provider) if isinstance(provider, str) else None
            if rated is None or rated == member or rated.identity != event.provider:
                return False
            if event.rating is None or claims.get("rating") != event.rating:
                return False
        self.admission.remember(envelope)
        before = self.latest.get(name)
        if before is None or before.time != event.time:
            before = LastRequest(event.seq, 0, event.time, "")
        digest = digest_of([event.token], before.digest)
        self.latest[name] = before._replace(size=before.size + 1, digest=digest)
        return True

    def _joins(self, event: Event, name: str) -> bool:
        """Let an agent join, and return whether it can with that key and identity."""
        try:
            claims, _ = read_token(event.token, Registration)
            key = key_of_text(claims.key)
        except ValueError:
            return False
        if event.sender != self.next_identity(name) or self.keys.get(name, key) != key:
            return False
        if name not in self.keys and claims.recovery is not None:
            self.recovery[name] = key_of_text(claims.recovery)
        self.keys[name] = key
        self._begun[name] += 1
        receipt = Receipt(event.seq, event.time / MICROSECONDS)
        self.by_name[name] = Member(name, event.sender, claims.key, receipt)
        self.limit.admits(event.time * 1000)
        return True

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
    """Return the claims of a token that was read before; none if it is no token."""
    try:
        payload = token.split(".")[1]
        found = json.loads(urlsafe_b64decode(payload + "=" * (-len(payload) % 4)))
    except (ValueError, IndexError):
        return {}
    return found if isinstance(found, dict) else {}


def _stamp(iat: object) -> int:
    return round(iat * 1e6) * 1000 if isinstance(iat, int | float) else -1
