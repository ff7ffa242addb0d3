"""Check of a store by anybody who has a copy: signatures, order and trust."""

from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

from roletrust_env.logs.evidence import Role
from roletrust_env.trust.model import TrustModel
from roletrust_manager.admission.keys import KnownKeys
from roletrust_manager.admission.validation import is_genuine
from roletrust_manager.http.journal_trust import JournalTrust, Ranking
from roletrust_manager.http.members import Members, name_of
from roletrust_manager.http.requests import MICROSECONDS, Settings
from roletrust_manager.http.tokens import (
    Claims,
    Leave,
    Rating,
    Registration,
    Rotation,
    has_proofs,
    read_token,
)
from roletrust_manager.journal.merkle import MerkleTree
from roletrust_manager.journal.sql import JournalStore
from roletrust_manager.journal.verify import event_leaf

_KINDS: dict[str, type[Claims]] = {
    "register": Registration,
    "rating": Rating,
    "rotate": Rotation,
    "leave": Leave,
}


class CheckedStore(NamedTuple):
    """What a store has.

    Attributes:
        events: Number of events.
        root: Root hash of their Merkle tree.
        rankings: Agents by role, the best first, with the trust of all ratings.
    """

    events: int
    root: bytes
    rankings: Mapping[Role, Ranking]


def check_store(
    path: Path,
    model: TrustModel[Any],
    settings: Settings = Settings(),  # noqa: B008 - immutable
    keys: Mapping[str, Ed25519PublicKey] = MappingProxyType({}),
) -> CheckedStore:
    """Check that each event was signed by its agent and is as its token says, that none is missing,
    and compute trust.

    Args:
        path: Store that no manager uses, such as a backup.
        model: Trust model.
        settings: Length of a round, scale and roles of the manager.
        keys: Public keys that agents have or had, which are known otherwise, by name.

    Raises:
        ValueError: The scale is not allowed.
        StoreError: The store cannot be read, or is damaged.
    """
    with closing(JournalStore(str(path))) as store:
        trust = JournalTrust(store, model, settings)
        store.open()
        return _check_events(store, trust, settings, keys)


def _check_events(
    store: JournalStore,
    trust: JournalTrust,
    settings: Settings,
    keys: Mapping[str, Ed25519PublicKey],
) -> CheckedStore:
    members, tree, seq, end = Members(settings, store.name), MerkleTree(), 0, 0.0
    seen, unknown = set[str](), dict[str, int]()  # agents whose known key has not come yet
    for event in store.history():
        name = name_of(event.sender)
        key = members.keys.get(name)
        if (said := members.fits(event)) is None:
            raise store.damaged(event.seq, f"{name!r} cannot have sent this {event.kind}")
        members.follow(event, said)
        key = key or members.keys[name]  # of a registration
        claims, envelope = read_token(event.token, _KINDS[event.kind])
        if keys.get(name) == members.keys[name]:
            unknown.pop(name, None)
        elif event.kind == "register" and name in keys and name not in seen:
            unknown[name] = event.seq
        seen.add(name)
        is_proved = not isinstance(claims, Rotation) or has_proofs(
            claims, members.recovery.get(name)
        )
        if not is_proved or not is_genuine(envelope, KnownKeys({name: key})):
            raise store.damaged(event.seq, f"{name!r} has not signed it")
        seq, end = event.seq, event.time / MICROSECONDS
        tree.append(event_leaf(seq, event.time, event.token))
        if event.kind == "rating":
            trust.expect(end)
    for name, first in unknown.items():
        raise store.damaged(first, f"{name!r} has another key")
    store.check_head(seq, tree.root())
    trust.advance(end + 2 * settings.every)
    return CheckedStore(seq, tree.root(), trust.rankings)
