"""Snapshots of a trust manager, so that a start does not replay the whole journal.

A snapshot is a file of arrays next to a store of SQLite, see `roletrust_env.storage.arrays`. It is
never more than a shortcut: one that is damaged, of other settings or of other events is ignored.
"""

from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import NonNegativeInt

from roletrust_env.storage.arrays import load_arrays, save_arrays
from roletrust_env.storage.untrusted import UntrustedModel
from roletrust_env.trust.stored import taken
from roletrust_manager.http.journal_trust import StoredTrust
from roletrust_manager.http.members import StoredMembers
from roletrust_manager.journal.lines import snapshot_path
from roletrust_manager.journal.merkle import MerkleTree
from roletrust_manager.journal.sql import JournalStore


class Snapshot(NamedTuple):
    """All that a manager keeps in memory.

    Attributes:
        seq: Number of the last event.
        time: Time of the last event, microseconds.
        ratings: Number of ratings.
        members: What `Members` keep.
        tree: Tree of the events.
        trust: What `JournalTrust` keeps.
        digests: Digests of the events, see `JournalStore.digests`.
    """

    seq: int
    time: int
    ratings: int
    members: StoredMembers
    tree: MerkleTree
    trust: StoredTrust
    digests: list[str]


class _Header(UntrustedModel):
    snapshot: Literal[1] = 1
    about: dict[str, Any]
    digests: list[str]
    seq: NonNegativeInt
    time: NonNegativeInt
    ratings: NonNegativeInt
    members: StoredMembers
    trust: tuple[NonNegativeInt, NonNegativeInt, NonNegativeInt, int | None, int | None]


def write_snapshot(store: Path, about: dict[str, Any], snapshot: Snapshot) -> None:
    """Write a snapshot next to the file of a store.

    Raises:
        OSError: It cannot be written.
    """
    header = _Header(
        about=about,
        digests=snapshot.digests,
        seq=snapshot.seq,
        time=snapshot.time,
        ratings=snapshot.ratings,
        members=snapshot.members,
        trust=snapshot.trust[:-1],
    )
    arrays = {
        "header": np.frombuffer(header.model_dump_json().encode(), np.uint8),
        "tree": np.frombuffer(snapshot.tree.hashes, np.uint8),
        "stream": np.frombuffer(snapshot.trust.stream, np.uint8),
    }
    save_arrays(snapshot_path(store), arrays)


def read_snapshot(store: JournalStore, about: dict[str, Any]) -> Snapshot | None:
    """Return the snapshot of a store; None if there is none that fits.

    Raises:
        StoreError: The store cannot be read.
    """
    if store.path is None:
        return None
    try:
        arrays = load_arrays(snapshot_path(store.path))
        header = _Header.model_validate_json(taken(arrays, "header", np.uint8, (None,)).tobytes())
        hashes, stream = (
            taken(arrays, name, np.uint8, (None,)).tobytes() for name in ("tree", "stream")
        )
        tree = MerkleTree.restored(hashes, header.seq)
    except (ValueError, OSError):
        return None
    if header.about != about or header.digests != store.digests(header.seq):
        return None
    trust = StoredTrust(*header.trust, stream)
    at = (header.seq, header.time, header.ratings)
    return Snapshot(*at, header.members, tree, trust, header.digests)
