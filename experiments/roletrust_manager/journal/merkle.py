"""Merkle tree of a journal: one hash for all events, and short proofs about it (RFC 6962, section
2.1, and RFC 9162, section 2.1).

MTH of n leaves d is SHA-256("") for n = 0, SHA-256(0x00 || d) for n = 1, and otherwise
SHA-256(0x01 || MTH(d[:k]) || MTH(d[k:])) for the largest power of two k < n.
"""

from collections.abc import Sequence
from hashlib import sha256

HASH_SIZE = 32
"""Number of bytes of a hash."""


def leaf_hash(leaf: bytes) -> bytes:
    """Return the hash of a leaf, SHA-256(0x00 || leaf)."""
    return sha256(b"\x00" + leaf).digest()


def _node_hash(left: bytes, right: bytes) -> bytes:
    return sha256(b"\x01" + left + right).digest()


class MerkleTree:
    """Tree that grows by leaves at its end. It stores the hash of each complete subtree once, so a
    proof among n leaves takes O(log n) steps. One thread may append while others read.

    Args:
        leaves: Hashes of the first leaves, one after another.

    Raises:
        ValueError: The number of bytes of `leaves` is not a multiple of `HASH_SIZE`.
    """

    def __init__(self, leaves: bytes = b"") -> None:
        if len(leaves) % HASH_SIZE:
            raise ValueError(f"leaves must have {HASH_SIZE} bytes each, got {len(leaves)} bytes")
        level = bytearray(leaves)
        self._levels = [level]  # level h has the subtrees of 2^h leaves, from left to right
        while (count := len(level) // HASH_SIZE) > 1:
            level = bytearray().join(
                _node_hash(_hash_at(level, left), _hash_at(level, left + 1))
                for left in range(0, count - 1, 2)
            )
            self._levels.append(level)

    def __len__(self) -> int:
        return len(self._levels[0]) // HASH_SIZE

    @property
    def hashes(self) -> bytes:
        """Hashes of all complete subtrees, level by level from the leaves on, for `restored`."""
        return b"".join(self._levels)

    @classmethod
    def restored(cls, hashes: bytes, size: int) -> "MerkleTree":
        """Return the tree of so many leaves from all that it stores, which is believed.

        Raises:
            ValueError: The number of bytes is not that of such a tree.
        """
        tree, at = cls(), 0
        tree._levels = []
        while count := size >> len(tree._levels):
            tree._levels.append(bytearray(hashes[at : at + count * HASH_SIZE]))
            at += count * HASH_SIZE
        if at != len(hashes):
            raise ValueError(f"a tree of {size} leaves has {at} bytes, got {len(hashes)}")
        tree._levels = tree._levels or [bytearray()]
        return tree

    def truncate(self, size: int) -> None:
        """Take back the leaves after the first ones."""
        for height, level in enumerate(self._levels):
            del level[(size >> height) * HASH_SIZE :]

    def append(self, leaf: bytes) -> None:
        """Append a leaf, given as its content."""
        nodes, index = [leaf_hash(leaf)], len(self)
        while index % 2:
            left_sibling = _hash_at(self._levels[len(nodes) - 1], index - 1)
            nodes.append(_node_hash(left_sibling, nodes[-1]))
            index //= 2
        if len(nodes) > len(self._levels):
            self._levels.append(bytearray())
        for level in reversed(range(len(nodes))):  # the leaf last, so that readers see no gap
            self._levels[level] += nodes[level]

    def root(self, size: int | None = None) -> bytes:
        """Return the root hash of the first `size` leaves; of all for None.

        Raises:
            ValueError: The tree has fewer leaves.
        """
        size = len(self) if size is None else size
        _check("size", size, 0, len(self))
        return self._subtree(0, size) if size else sha256().digest()

    def inclusion(self, index: int, size: int) -> list[bytes]:
        """Return the proof that the leaf at an index, from 0, is among the first `size` leaves:
        PATH(index, D[size]) of RFC 6962.

        Raises:
            ValueError: The tree has fewer leaves, or the index is too large.
        """
        _check("size", size, 1, len(self))
        _check("index", index, 0, size - 1)
        return self._path(index, index + 1, size)

    def consistency(self, old: int, new: int) -> list[bytes]:
        """Return the proof that the tree of `new` leaves begins with the tree of `old` leaves:
        PROOF(old, D[new]) of RFC 6962. It is empty if `old` is 0 or `new`.

        Raises:
            ValueError: The tree has fewer leaves, or `old` is above `new`.
        """
        _check("new", new, 0, len(self))
        _check("old", old, 0, new)
        if old in (0, new):
            return []
        start = old & (old - 1)  # of the last complete subtree in the old tree
        known = [self._subtree(start, old)] if start else []  # else it is the old tree itself
        return known + self._path(start, old, new)

    def _path(self, start: int, end: int, size: int) -> list[bytes]:
        """Return the hashes next to the path from a complete subtree up to the root."""
        proof, left, right = [], 0, size
        while right - left > end - start:
            split = _split(left, right)
            if start < split:
                proof.append(self._subtree(split, right))
                right = split
            else:
                proof.append(self._subtree(left, split))
                left = split
        return proof[::-1]

    def _subtree(self, start: int, end: int) -> bytes:
        """Return MTH of the leaves from `start` to `end`; only the last subtree is incomplete."""
        level = (end - start).bit_length() - 1
        if end - start == 1 << level:
            return _hash_at(self._levels[level], start >> level)
        split = _split(start, end)
        return _node_hash(self._subtree(start, split), self._subtree(split, end))


def _hash_at(level: bytearray, index: int) -> bytes:
    return bytes(level[index * HASH_SIZE : (index + 1) * HASH_SIZE])


def _split(start: int, end: int) -> int:
    """Return where the right subtree of two or more leaves starts."""
    return start + (1 << (end - start - 1).bit_length() - 1)


def _check(name: str, number: int, least: int, most: int) -> None:
    if not least <= number <= most:
        raise ValueError(f"{name} must be in [{least}, {most}], got {number}")


def verify_inclusion(
    leaf_hash: bytes, index: int, size: int, proof: Sequence[bytes], root: bytes
) -> bool:
    """Return whether a proof shows that the leaf at an index, from 0, has a hash in the tree of
    `size` leaves with that root (RFC 9162, section 2.1.3.2).
    """
    if not 0 <= index < size:
        return False
    roots = _climb(index, size - 1, [leaf_hash, *proof])
    return roots is not None and roots[1] == root


def verify_consistency(
    old: int, new: int, old_root: bytes, new_root: bytes, proof: Sequence[bytes]
) -> bool:
    """Return whether a proof shows that the tree of `new` leaves begins with the tree of `old`
    leaves (RFC 9162, section 2.1.4.2). An empty proof is enough if `old` is 0 or `new`.
    """
    if old == 0 or old == new:
        expected = new_root if old == new else sha256().digest()
        return not proof and old_root == expected
    if not 0 < old < new or not proof:
        return False
    width = old & -old  # number of leaves of the last complete subtree in the old tree
    nodes = [old_root, *proof] if width == old else proof
    return _climb(old // width - 1, (new - 1) // width, nodes) == (old_root, new_root)


def _climb(position: int, last: int, nodes: Sequence[bytes]) -> tuple[bytes, bytes] | None:
    """Return the roots of two trees from the hash of a node that both have, the first of `nodes`,
    and its siblings up to the root; None if the siblings do not fit the sizes.

    The node is the last of its level in the old tree. In the new tree, the level ends at `last`.
    """
    if any(len(node) != HASH_SIZE for node in nodes):  # || would be ambiguous
        return None
    old = new = nodes[0]
    for sibling in nodes[1:]:
        if last == 0:
            return None
        if position % 2 or position == last:
            old, new = _node_hash(sibling, old), _node_hash(sibling, new)
            while position and not position % 2:
                position, last = position >> 1, last >> 1
        else:
            new = _node_hash(new, sibling)
        position, last = position >> 1, last >> 1
    return (old, new) if last == 0 else None
