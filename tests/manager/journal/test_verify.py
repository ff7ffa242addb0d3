"""What a verifier detects with exports, receipts, signed checkpoints and the public key only."""

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from refusals import refuses

from roletrust_manager.journal.checkpoint import Checkpoint, read_checkpoint, sign_checkpoint
from roletrust_manager.journal.merkle import MerkleTree, leaf_hash
from roletrust_manager.journal.verify import (
    HistoryError,
    check_consistent,
    check_export,
    check_receipt,
    event_leaf,
)

KEY = Ed25519PrivateKey.from_private_bytes(bytes(32))
TOKENS = [f"token.{number}.ä" for number in range(11)]
RATING = 6  # index of the rating that is omitted or altered


def journal(tokens):
    """The leaves of a manager that has acknowledged some tokens, and their tree."""
    leaves = [event_leaf(seq, 10**15 + seq, token) for seq, token in enumerate(tokens, 1)]
    return leaves, MerkleTree(b"".join(map(leaf_hash, leaves)))


def checkpoint(tree, size=None):
    """A checkpoint as a verifier has it: signed by the manager, and read with its public key."""
    size = len(tree) if size is None else size
    text = sign_checkpoint(Checkpoint("roletrust/trust", size, tree.root(size)), KEY)
    return read_checkpoint(text, KEY.public_key())


LEAVES, TREE = journal(TOKENS)
OMITTED = journal(TOKENS[:RATING] + TOKENS[RATING + 1 :])
ALTERED = journal([*TOKENS[:RATING], "token.altered", *TOKENS[RATING + 1 :]])


def test_a_leaf_is_of_number_time_and_token():
    assert event_leaf(7, 1764181371500000, "ä.b.c") == b"7\n1764181371500000\n\xc3\xa4.b.c"


def test_an_honest_history_is_accepted():
    for size in range(len(TOKENS) + 1):
        check_export(LEAVES, checkpoint(TREE, size))
        check_consistent(
            checkpoint(TREE, size), checkpoint(TREE), TREE.consistency(size, len(TREE))
        )
        for index in range(size):
            check_receipt(LEAVES[index], index, TREE.inclusion(index, size), checkpoint(TREE, size))


@pytest.mark.parametrize("forged", [OMITTED, ALTERED])
def test_an_agent_proves_that_its_rating_is_omitted_or_altered(forged):
    export, forged_tree = forged
    known = checkpoint(TREE, 9)
    receipt = TREE.inclusion(RATING, 9)
    check_receipt(LEAVES[RATING], RATING, receipt, known)
    assert LEAVES[RATING] not in export
    with refuses(HistoryError, 9, TREE.root(9).hex(), forged_tree.root(9).hex()):
        check_export(export, known)
    later = checkpoint(forged_tree)  # the manager signs the forged journal
    check_export(export, later)
    proof = forged_tree.consistency(9, later.size)
    with refuses(HistoryError, later.size, later.root.hex(), 9, known.root.hex()):
        check_consistent(known, later, proof)


def test_an_export_without_the_last_events_is_too_short():
    check_export(LEAVES[:9], checkpoint(TREE, 9))
    with refuses(HistoryError, 11, 9):
        check_export(LEAVES[:9], checkpoint(TREE))


def test_a_receipt_of_another_event_or_position_is_refused():
    known, proof = checkpoint(TREE), TREE.inclusion(RATING, len(TREE))
    for leaf, index in (
        (LEAVES[RATING + 1], RATING),
        (event_leaf(RATING + 1, 10**15 + RATING, TOKENS[RATING]), RATING),  # another time
        (LEAVES[RATING], RATING + 1),
        (LEAVES[RATING], len(TREE)),
    ):
        with refuses(HistoryError, leaf_hash(leaf).hex(), index, len(TREE), known.root.hex()):
            check_receipt(leaf, index, proof, known)


def test_two_histories_of_one_size_are_detected():
    known, forged = checkpoint(TREE), checkpoint(ALTERED[1])
    assert known.size == forged.size
    with refuses(HistoryError, known.size, known.root.hex(), forged.root.hex()):
        check_consistent(known, forged, [])


def test_two_histories_of_different_sizes_are_detected():
    for size in range(RATING + 1, len(TREE)):
        known, forged = checkpoint(TREE, size), checkpoint(ALTERED[1])
        for tree in (TREE, ALTERED[1]):
            with refuses(HistoryError, size, known.root.hex(), forged.root.hex()):
                check_consistent(known, forged, tree.consistency(size, len(tree)))
    for size in range(RATING + 1):  # before the altered event, the history is the same
        check_consistent(
            checkpoint(TREE, size),
            checkpoint(ALTERED[1]),
            ALTERED[1].consistency(size, len(ALTERED[1])),
        )


def test_checkpoints_that_cannot_be_compared_are_no_evidence():
    with refuses(ValueError, 9, 11) as error:
        check_consistent(checkpoint(TREE), checkpoint(TREE, 9), [])
    assert error.type is ValueError
    other = checkpoint(TREE)._replace(origin="roletrust/other")
    with refuses(ValueError, "roletrust/trust", "roletrust/other") as error:
        check_consistent(checkpoint(TREE), other, [])
    assert error.type is ValueError
