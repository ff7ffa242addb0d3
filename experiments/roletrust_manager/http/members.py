"""The members of a trust manager: who has registered, with which key, and what each sent last."""

import json
from base64 import urlsafe_b64decode
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from hashlib import sha256
from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from pydantic import NonNegativeInt

from roletrust_env.storage.untrusted import UntrustedModel
from roletrust_manager.admission.keys import KnownKeys
from roletrust_manager.admission.validation import (
    Envelope,
    LastStamp,
    MessageValidator,
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
        validator: Checks when and by whom tokens were signed.
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
        self.validator = MessageValidator(limits, self.keyring)
        self.limit = NewcomerLimit(settings.newcomers, round(settings.every * 1e9))

    @property
    def begun(self) -> int:
        """Number of agents that have ever been there; who comes back is another one."""
        return self._begun.total()

    def join(self, claims: Registration, receipt: Receipt) -> Member:
        """Let an agent join, whose key is known."""
        name = claims.iss
        self._begun[name] += 1
        identity = name if self._begun[name] == 1 else f"{name}{_AGAIN}{self._begun[name]}"
        self.by_name[name] = Member(name, identity, claims.key, receipt)
        return self.by_name[name]

    def unjoin(self, name: str) -> None:
        """Undo that an agent has joined."""
        self._begun[name] -= 1
        del self.by_name[name]

    def follow(self, history: Iterator[Event], damaged: Callable[[int, str], Exception]) -> None:
        """Take events into account that a manager has acknowledged.

        Args:
            history: Events, in order.
            damaged: Function that returns the error of an event, by its number and what is wrong.
        """
        last = dict[str, list[Event]]()  # the events of the last request of each agent
        for event in history:
            name = name_of(event.sender)
            claims = _claims(event.token)
            if not self._follows(event, name, claims):
                raise damaged(
                    event.seq, f"{event.sender!r} cannot have sent this {event.kind} then"
                )
            self.validator.remember(Envelope(name, event.stamp, nonce=claims.get("jti") or ""))
            if name in last and last[name][0].time == event.time:
                last[name].append(event)
            else:
                last[name] = [event]
        for name, events in last.items():
            digest = digest_of([event.token for event in events])
            self.latest[name] = LastRequest(events[0].seq, len(events), events[0].time, digest)

    def _follows(self, event: Event, name: str, claims: dict[str, Any]) -> bool:
        """Take an event into account; return whether its agent can have sent it, and its token says
        the same.
        """
        member = self.by_name.get(name)
        envelope = Envelope(name, event.stamp, nonce=claims.get("jti") or "")
        if not self.validator.is_new(envelope) or (event.kind == "register") != (member is None):
            return False
        said = claims.get("kind"), claims.get("iss"), _stamp(claims.get("iat"))
        if said != (event.kind, name, event.stamp):
            return False
        if event.kind == "register":
            try:
                registration, _ = read_token(event.token, Registration)
                key = key_of_text(registration.key)
            except ValueError:
                return False
            if name not in self.keys and registration.recovery is not None:
                self.recovery[name] = key_of_text(registration.recovery)
            if self.keys.setdefault(name, key) != key:
                return False
            member = self.join(registration, Receipt(event.seq, event.time / MICROSECONDS))
            self.limit.admits(event.time * 1000)
        elif event.kind == "leave":
            del self.by_name[name]
        elif event.kind == "rotate" and member is not None:
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
        return member is not None and member.identity == event.sender

    def save(self) -> StoredMembers:
        """Return all that is kept."""
        last = self.validator.last
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
            self.validator.put_back(name, LastStamp(stamp, frozenset(stored.nonces.get(name, ()))))
        self.limit.state = stored.newcomers


def name_of(identity: str) -> str:
    """Return the name of an agent, see `Member.identity`."""
    return identity.partition(_AGAIN)[0]


def digest_of(tokens: Sequence[str]) -> str:
    """Return the SHA-256 of the tokens of a request."""
    return sha256("\n".join(tokens).encode()).hexdigest()


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
