"""The Merkle tree against published vectors, and against the recursion of RFC 6962."""

import sys
from hashlib import sha256

import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from roletrust_manager.journal.merkle import (
    MerkleTree,
    leaf_hash,
    verify_consistency,
    verify_inclusion,
)

LEAVES = [  # of the tests of Certificate Transparency, as the roots and proofs below
    bytes.fromhex(leaf)
    for leaf in (
        "",
        "00",
        "10",
        "2021",
        "3031",
        "40414243",
        "5051525354555657",
        "606162636465666768696a6b6c6d6e6f",
    )
]
ROOTS = [
    "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
    "6e340b9cffb37a989ca544e6bb780a2c78901d3fb33738768511a30617afa01d",
    "fac54203e7cc696cf0dfcb42c92a1d9dbaf70ad9e621f4bd8d98662f00e3c125",
    "aeb6bcfe274b70a14fb067a5e5578264db0fa9b51af5e0ba159158f329e06e77",
    "d37ee418976dd95753c1c73862b9398fa2a2cf9b4ff0fdfe8b30cd95209614b7",
    "4e3bbb1f7b478dcfe71fb631631519a3bca12c9aefca1612bfce4c13a86264d4",
    "76e67dadbcdf1e10e1b74ddc608abd2f98dfb16fbce75277b5232a127f2087ef",
    "ddb89be403809e325750d3d263cd78929c2942b7942a34b77e122c9594a74c8c",
    "5dc9da79a70659a9ad559cb701ded9a2ab9d823aad2f4960cfe370eff4604328",
]
LEAF_0, LEAF_1, LEAF_4 = (leaf_hash(LEAVES[index]).hex() for index in (0, 1, 4))
NODE_23 = "5f083f0a1a33ca076a95279832580db3e0ef4584bdff1f54c8a360f50de3031e"
NODE_45 = "0ebc5d3437fbe2db158b9f126a1d118e308181031d0a949f8dededebc558ef6a"
NODE_67 = "ca854ea128ed050b41b35ffc1b87b8eb2bde461e9e3b5596ece6b9d5975a0ae0"
NODE_47 = "6b47aaf29ee3c2af9af889bc1fb9254dabd31177f16232dd6aab035ca39bf6e4"


def slow_root(leaves):
    if not leaves:
        return sha256().digest()
    if len(leaves) == 1:
        return sha256(b"\0" + leaves[0]).digest()
    k = largest_power_below(len(leaves))
    return sha256(b"\1" + slow_root(leaves[:k]) + slow_root(leaves[k:])).digest()


def slow_path(m, leaves):
    if len(leaves) == 1:
        return []
    k = largest_power_below(len(leaves))
    if m < k:
        return [*slow_path(m, leaves[:k]), slow_root(leaves[k:])]
    return [*slow_path(m - k, leaves[k:]), slow_root(leaves[:k])]


def slow_subproof(m, leaves, complete):
    if m == len(leaves):
        return [] if complete else [slow_root(leaves)]
    k = largest_power_below(len(leaves))
    if m <= k:
        return [*slow_subproof(m, leaves[:k], complete), slow_root(leaves[k:])]
    return [*slow_subproof(m - k, leaves[k:], False), slow_root(leaves[:k])]


def largest_power_below(n):
    return max(2**i for i in range(n) if 2**i < n)


def tree_of(leaves):
    tree = MerkleTree()
    for leaf in leaves:
        tree.append(leaf)
    return tree


def hexes(proof):
    return [node.hex() for node in proof]


def flipped(data, bit):
    changed = bytearray(data)
    changed[bit // 8 % len(changed)] ^= 1 << bit % 8
    return bytes(changed)


def test_roots_are_the_published_ones():
    tree = MerkleTree()
    grown = [tree.root().hex()]
    for leaf in LEAVES:
        tree.append(leaf)
        grown.append(tree.root().hex())
    assert grown == ROOTS
    assert [tree.root(size).hex() for size in range(9)] == ROOTS
    assert len(tree) == 8


@pytest.mark.parametrize(
    ("index", "size", "proof"),
    [
        (0, 1, []),
        (0, 2, [LEAF_1]),
        (1, 2, [LEAF_0]),
        (2, 3, [ROOTS[2]]),
        (1, 5, [LEAF_0, NODE_23, LEAF_4]),
        (0, 8, [LEAF_1, NODE_23, NODE_47]),
        (5, 8, [LEAF_4, NODE_67, ROOTS[4]]),
    ],
)
def test_inclusion_proofs_are_the_published_ones(index, size, proof):
    assert hexes(tree_of(LEAVES).inclusion(index, size)) == proof


@pytest.mark.parametrize(
    ("old", "new", "proof"),
    [
        (1, 1, []),
        (1, 8, [LEAF_1, NODE_23, NODE_47]),
        (2, 5, [NODE_23, LEAF_4]),
        (6, 8, [NODE_45, NODE_67, ROOTS[4]]),
    ],
)
def test_consistency_proofs_are_the_published_ones(old, new, proof):
    assert hexes(tree_of(LEAVES).consistency(old, new)) == proof


def test_all_sizes_agree_with_the_recursion_of_the_rfc():
    leaves = [str(index).encode() for index in range(40)]
    tree = tree_of(leaves)
    roots = [slow_root(leaves[:size]) for size in range(41)]
    assert [tree.root(size) for size in range(41)] == roots
    for size in range(1, 41):
        for index in range(size):
            proof = tree.inclusion(index, size)
            assert proof == slow_path(index, leaves[:size])
            hashed = leaf_hash(leaves[index])
            fits = [
                verify_inclusion(hashed, other, size, proof, roots[size]) for other in range(41)
            ]
            assert fits == [other == index for other in range(41)]
        for old in range(1, size + 1):
            proof = tree.consistency(old, size)
            assert proof == slow_subproof(old, leaves[:size], True)
            assert verify_consistency(old, size, roots[old], roots[size], proof)


def test_every_tree_begins_with_the_empty_one_only():
    empty, root = (bytes.fromhex(ROOTS[size]) for size in (0, 8))
    assert tree_of(LEAVES).consistency(0, 8) == []
    assert verify_consistency(0, 8, empty, root, [])
    assert verify_consistency(0, 0, empty, empty, [])
    assert not verify_consistency(0, 8, root, root, [])
    assert not verify_consistency(0, 8, empty, root, [root])
    assert not verify_consistency(0, 0, empty, root, [])
    assert not verify_consistency(0, 0, root, empty, [])


@given(st.integers(2, 100), st.data())
def test_any_changed_bit_is_refused(size, data):
    tree = tree_of([str(index).encode() for index in range(size)])
    index = data.draw(st.integers(0, size - 1))
    old = data.draw(st.integers(1, size - 1))
    bit = data.draw(st.integers(0, 255))
    root, hashed, proof = tree.root(), tree.hashes[32 * index :][:32], tree.inclusion(index, size)
    assert verify_inclusion(hashed, index, size, proof, root)
    assert not verify_inclusion(flipped(hashed, bit), index, size, proof, root)
    assert not verify_inclusion(hashed, index, size, proof, flipped(root, bit))
    for at, node in enumerate(proof):
        changed = [*proof[:at], flipped(node, bit), *proof[at + 1 :]]
        assert not verify_inclusion(hashed, index, size, changed, root)
    proof, old_root = tree.consistency(old, size), tree.root(old)
    assert verify_consistency(old, size, old_root, root, proof)
    assert not verify_consistency(old, size, flipped(old_root, bit), root, proof)
    assert not verify_consistency(old, size, old_root, flipped(root, bit), proof)
    for at, node in enumerate(proof):
        changed = [*proof[:at], flipped(node, bit), *proof[at + 1 :]]
        assert not verify_consistency(old, size, old_root, root, changed)


@given(st.integers(2, 100), st.data())
def test_a_proof_of_another_length_is_refused(size, data):
    tree = tree_of([str(index).encode() for index in range(size)])
    index = data.draw(st.integers(0, size - 1))
    old = data.draw(st.integers(1, size - 1))
    root, hashed = tree.root(), tree.hashes[32 * index :][:32]
    inclusion, consistency = tree.inclusion(index, size), tree.consistency(old, size)
    for change in (lambda proof: proof[:-1], lambda proof: [*proof, root], lambda proof: proof[1:]):
        assert not verify_inclusion(hashed, index, size, change(inclusion), root)
        assert not verify_consistency(old, size, tree.root(old), root, change(consistency))
    assert not verify_inclusion(hashed, index, size, [], b"")
    assert not verify_inclusion(hashed, -1, size, inclusion, root)
    assert not verify_inclusion(hashed, index, 0, inclusion, root)
    assert not verify_consistency(old, size, b"", b"", [])
    assert not verify_consistency(size, old, root, tree.root(old), consistency)
    assert not verify_consistency(-1, size, root, root, consistency)


def test_a_root_of_another_size_is_refused():
    left, right, root = (bytes.fromhex(node) for node in (LEAF_0, LEAF_1, ROOTS[2]))
    assert verify_inclusion(right, 1, 2, [left], root)
    assert not verify_inclusion(right, 0, 1, [left], root)
    assert verify_consistency(1, 2, left, root, [right])
    assert not verify_consistency(2, 1, left, root, [right])
    assert not verify_consistency(6, 4, left, root, [left, right])


def test_a_boundary_between_hashes_cannot_be_moved():
    tree = tree_of(LEAVES[:2])
    pair = tree.hashes[:64]
    assert verify_inclusion(pair[:32], 0, 2, [pair[32:]], tree.root())
    assert not verify_inclusion(pair[:31], 0, 2, [pair[31:]], tree.root())


@pytest.mark.parametrize("size", [0, 1, 2, 3, 8, 39, 64, 100])
def test_a_tree_continues_from_what_it_stores_and_takes_leaves_back(size):
    leaves = [str(index).encode() for index in range(120)]
    saved = tree_of(leaves[:size])
    loaded = MerkleTree.restored(saved.hashes, size)
    assert len(loaded) == size
    for leaf in leaves[: size // 2]:
        loaded.append(leaf)
    loaded.truncate(size)
    assert len(loaded) == size
    assert loaded.root() == saved.root() == slow_root(leaves[:size])
    for leaf in leaves[size:]:
        loaded.append(leaf)
    whole = tree_of(leaves)
    assert [loaded.root(old) for old in range(121)] == [whole.root(old) for old in range(121)]


def test_a_reader_never_sees_half_an_append():
    tree, seen = MerkleTree(), set()

    def read(frame, event, argument):
        if frame.f_code is MerkleTree.append.__code__:
            sys.settrace(None)
            seen.add((len(tree), tree.root().hex()))
            sys.settrace(read)
        return read

    tracer = sys.gettrace()
    sys.settrace(read)
    try:
        for leaf in LEAVES:
            tree.append(leaf)
    finally:
        sys.settrace(tracer)
    assert seen == set(enumerate(ROOTS))


def test_what_a_tree_does_not_have_is_refused():
    tree = tree_of(LEAVES)
    for words, call in (
        (("size", "[0, 8]", 9), lambda: tree.root(9)),
        (("size", "[0, 8]", -1), lambda: tree.root(-1)),
        (("size", "[1, 8]", 9), lambda: tree.inclusion(0, 9)),
        (("size", "[1, 8]", 0), lambda: tree.inclusion(0, 0)),
        (("index", "[0, 4]", 5), lambda: tree.inclusion(5, 5)),
        (("index", "[0, 4]", -1), lambda: tree.inclusion(-1, 5)),
        (("new", "[0, 8]", 9), lambda: tree.consistency(1, 9)),
        (("old", "[0, 4]", 5), lambda: tree.consistency(5, 4)),
        (("leaves", 32, 33), lambda: MerkleTree(bytes(33))),
        (("3", 128, 96), lambda: MerkleTree.restored(bytes(96), 3)),
    ):
        with refuses(ValueError, *words):
            call()
