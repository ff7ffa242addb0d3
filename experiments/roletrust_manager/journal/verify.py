"""Checks of a manager's history with exports, signed checkpoints and receipts only.

An export has the leaves of all events in order, see `event_leaf`. A receipt is a leaf with the
proof that it is in the journal of a signed checkpoint. The checkpoint must have been read by
`read_checkpoint`, which verifies its signature.

A receipt that is valid and an export that does not fit the same checkpoint prove that the export
is altered. Two signed checkpoints of the same size with different roots prove that the manager
has two histories. A refused proof alone proves nothing: anybody can send a wrong one.
"""

from collections.abc import Sequence

from roletrust_manager.journal.checkpoint import Checkpoint
from roletrust_manager.journal.merkle import (
    MerkleTree,
    leaf_hash,
    verify_consistency,
    verify_inclusion,
)


class HistoryError(ValueError):
    """An export, a receipt or a checkpoint does not fit a signed checkpoint."""


def event_leaf(seq: int, time: int, token: str) -> bytes:
    """Return the leaf of an event: its number, its time in microseconds and its token, as lines."""
    return f"{seq}\n{time}\n{token}".encode()


def check_export(leaves: Sequence[bytes], checkpoint: Checkpoint) -> None:
    """Check that an export begins with the events of a checkpoint. It may have later events, too.

    Raises:
        HistoryError: The export has fewer events, or another root at the checkpoint's size.
    """
    if len(leaves) < checkpoint.size:
        raise HistoryError(
            f"the checkpoint has {checkpoint.size} events, the export has {len(leaves)}"
        )
    tree = MerkleTree(b"".join(leaf_hash(leaf) for leaf in leaves[: checkpoint.size]))
    if tree.root() != checkpoint.root:
        raise HistoryError(
            f"the root of {checkpoint.size} events is {checkpoint.root.hex()} in the checkpoint, "
            f"and {tree.root().hex()} in the export"
        )


def check_receipt(leaf: bytes, index: int, proof: Sequence[bytes], checkpoint: Checkpoint) -> None:
    """Check that a leaf is in the journal of a checkpoint.

    Args:
        leaf: Leaf of the event, see `event_leaf`.
        index: Index of the leaf, from 0: one less than the number of the event.
        proof: Proof, see `MerkleTree.inclusion`.
        checkpoint: Checkpoint with the size for which the proof was made.

    Raises:
        HistoryError: The proof does not show that.
    """
    hashed = leaf_hash(leaf)
    if not verify_inclusion(hashed, index, checkpoint.size, proof, checkpoint.root):
        raise HistoryError(
            f"the receipt does not show that the leaf {hashed.hex()} has index {index} among the "
            f"{checkpoint.size} events with root {checkpoint.root.hex()}"
        )


def check_consistent(older: Checkpoint, newer: Checkpoint, proof: Sequence[bytes]) -> None:
    """Check that the journal of a checkpoint begins with the journal of another one.

    Args:
        older: Checkpoint of the smaller or equal size.
        newer: Checkpoint of the larger or equal size, of the same origin.
        proof: Proof, see `MerkleTree.consistency`.

    Raises:
        HistoryError: The proof does not show that.
        ValueError: The checkpoints are of two origins, or the older one is larger. That is not
            evidence against the manager.
    """
    if older.origin != newer.origin:
        raise ValueError(
            f"origin must be the same in both checkpoints, got {older.origin!r} and "
            f"{newer.origin!r}"
        )
    if older.size > newer.size:
        raise ValueError(
            f"the size of the older checkpoint must be at most {newer.size}, got {older.size}"
        )
    if not verify_consistency(older.size, newer.size, older.root, newer.root, proof):
        raise HistoryError(
            f"the proof does not show that the {newer.size} events with root {newer.root.hex()} "
            f"begin with the {older.size} events with root {older.root.hex()}"
        )
