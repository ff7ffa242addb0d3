"""Agents of tests of the trust manager: they register, rate and leave by tokens of their own."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from roletrust_manager.admission.validation import RefusalReason
from roletrust_manager.http.manager import TrustManager
from roletrust_manager.http.requests import Receipt, RefusedError, Request, Settings
from roletrust_manager.http.tokens import (
    Leave,
    Rating,
    Registration,
    Rotation,
    key_as_text,
    sign_token,
    with_proofs,
    with_work,
)
from roletrust_manager.journal.sql import JournalStore

NAME = "m"
START = 1_764_180_000.0
QUICK = Settings(work=2)


class Clock:
    """A clock that is set by hand, as is the time that has passed; each look takes no time."""

    def __init__(self, now: float = START) -> None:
        self.now, self.passed = now, 0.0

    def __call__(self) -> float:
        return self.now


class Agent:
    """An agent with a key, whose tokens are signed a millisecond after one another."""

    def __init__(self, name: str, clock: Clock, seed: int = 0) -> None:
        self.name, self._clock = name, clock
        self.key = Ed25519PrivateKey.from_private_bytes(f"{name}{seed}".encode().ljust(32, b"."))
        self._last = 0.0
        self.recovery: str | None = None

    def _claims(self) -> dict[str, Any]:
        self._last = round(max(self._clock(), self._last + 0.001), 6)
        return {"iss": self.name, "aud": NAME, "iat": self._last}

    def registration(self, work: int = QUICK.work) -> str:
        key = key_as_text(self.key.public_key())
        claims = Registration(**self._claims(), key=key, recovery=self.recovery)
        return sign_token(with_work(claims, work), self.key)

    def rating(self, provider: str, rating: float, **claims: Any) -> str:
        return sign_token(
            Rating(**{**self._claims(), "sub": provider, "rating": rating, **claims}), self.key
        )

    def rotation(self, seed: int, recovery: Ed25519PrivateKey | None = None) -> str:
        """A token by which the agent with another seed replaces the key of this one."""
        key = Agent(self.name, self._clock, seed).key
        claims = Rotation(**self._claims(), key=key_as_text(key.public_key()))
        return sign_token(with_proofs(claims, key, recovery), self.key)

    def farewell(self) -> str:
        return sign_token(Leave(**self._claims()), self.key)


class OneByOne(TrustManager):
    """A manager that takes a request at a time; a refusal or failure is raised."""

    def register(self, token: str) -> Receipt:
        return self._one(Request(Registration, [token]))[0]

    def rate(self, tokens: Sequence[str]) -> list[Receipt]:
        return self._one(Request(Rating, tokens))

    def rotate(self, name: str, token: str) -> Receipt:
        return self._one(Request(Rotation, [token], name))[0]

    def leave(self, name: str, token: str) -> Receipt:
        return self._one(Request(Leave, [token], name))[0]

    def _one(self, request: Request) -> list[Receipt]:
        (answer,) = self.take([self.check(request)])
        if isinstance(answer, Exception):
            raise answer
        return answer


@contextmanager
def managed(
    path: Path | str, clock: Clock, settings: Settings = QUICK, model: str = "role-trust"
) -> Iterator[OneByOne]:
    """A manager of a store, which is released at the end."""
    manager = OneByOne(
        JournalStore(str(path), NAME), model, settings, clock, monotonic=lambda: clock.passed
    )
    try:
        yield manager
    finally:
        manager.close()


def joined(manager: OneByOne, clock: Clock, *names: str) -> list[Agent]:
    agents = [Agent(name, clock) for name in names]
    for agent in agents:
        manager.register(agent.registration())
    return agents


def refused(manager: OneByOne, reason: RefusalReason, kind: str, *args: object) -> RefusedError:
    """Check that a request is refused for a reason, which is counted, and that nothing else
    changes."""
    before, counts = manager.about(), manager.refusals.copy()
    with pytest.raises(RefusedError) as caught:
        getattr(manager, kind)(*args)
    assert caught.value.reason is reason
    assert sum((manager.refusals - counts).values()) == 1
    changed = {name for name, value in manager.about().items() if value != before[name]}
    assert changed <= {"time"}
    return caught.value


def standings(manager: OneByOne) -> dict[str, tuple[object, ...]]:
    return {member.name: manager.standings(member) for member in manager.members()}
