"""Counter-based random numbers: each number is a function of a cell, a game and a key.

There is no state to carry along, so a number does not depend on how many others are made with it. A
game has the same random numbers alone and in a batch, on NumPy and on torch, and in either
precision. A compiler can make the numbers where they are used.

The hash is pcg4d (Jarzynski and Olano 2020, "Hash Functions for GPU Rendering", JCGT 9 (3)), which
turns four words of 32 bits into four others. A word is uint32 on NumPy and int32 on libraries
without uint32.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import islice

import numpy as np

from roletrust_env.arrays import Array, cast, namespace

Words = Sequence[Array]
"""Four arrays of words whose shapes can be broadcast. NumPy scalars are not allowed: on overflow
they warn."""

_MULTIPLIER, _INCREMENT = 1664525, 1013904223  # linear congruential generator of Numerical Recipes
BLOCK = 32_768
"""Number of hashes that NumPy makes at once. Smaller blocks need more calls, larger ones do not fit
into the cache."""

_UNIT = 2.0**-24


def counters(like: Array, count: int) -> Array:
    """Return the words 0, 1, ..., count - 1, on the library and device of `like`."""
    xp = namespace(like)
    return xp.arange(count, dtype=xp.uint32 if xp is np else xp.int32, device=like.device)


def scramble(words: Words) -> list[Array]:
    """Return the pcg4d hash of four words: four words that look independent of them."""
    mixed = _mix(*(word * _MULTIPLIER + _INCREMENT for word in words))
    return _mix(*_each(lambda word: word ^ _shifted(word, 16), mixed))


def uniform(like: Array, cells: int, games: Array, key: Words) -> Array:
    """Return random numbers from U[0, 1), all multiples of 2 ** -24.

    Args:
        like: Array of the library, dtype and device to work with.
        cells: Number of cells, C.
        games: Index of each game, words of shape (E,).
        key: Four words of shape (1,), or of shape (E,) if every game has its own key.

    Returns:
        Array of shape (C, E), in the dtype of `like`.
    """
    return _generate(like, cells, games, key, _uniforms)


def normal(like: Array, cells: int, games: Array, key: Words) -> Array:
    """Return random numbers from N(0, 1) by the method of Box and Muller (1958), at most 5.9 from
    0.

    The arguments are those of `uniform`.
    """
    return _generate(like, cells, games, key, _normals)


def _mix(x: Array, y: Array, z: Array, w: Array) -> list[Array]:
    x = x + y * w
    y = y + z * x
    z = z + x * y
    return [x, y, z, w + y * z]


def _generate(
    like: Array,
    cells: int,
    games: Array,
    key: Words,
    to_numbers: Callable[[Words, Array], Iterable[Array]],
) -> Array:
    """Return the numbers for all cells and games. One hash gives four numbers, each in another
    quarter of the cells.
    """
    groups = counters(like, -(-cells // 4))[:, None]
    n_quarters = -(-cells // max(1, len(groups)))  # 3 for 9 cells

    def quarters(groups: Array, games: Array, key: Words) -> list[Array]:
        return list(
            islice(
                to_numbers(scramble((groups + key[0], games + key[1], key[2], key[3])), like),
                n_quarters,
            )
        )

    if not isinstance(like, np.ndarray) or groups.size * games.size <= BLOCK:
        return namespace(like).concat(quarters(groups, games, key))[:cells]
    numbers = np.empty((n_quarters, groups.size, games.size), like.dtype)
    width = min(games.size, BLOCK)
    for columns in _slices(games.size, width):
        keys = [word if word.shape == (1,) else word[columns] for word in key]
        for rows in _slices(groups.size, max(1, BLOCK // width)):
            numbers[:, rows, columns] = quarters(groups[rows], games[columns], keys)
    return numbers.reshape(-1, games.size)[:cells]


def _slices(total: int, step: int) -> list[slice]:
    return [slice(at, at + step) for at in range(0, total, step)]


def _uniforms(words: Words, like: Array) -> list[Array]:
    return _each(lambda word: _fraction(word, like) * _UNIT, words)


def _normals(words: Words, like: Array) -> Iterable[Array]:
    xp, (x, y, z, w) = namespace(like), words
    radii = _each(
        lambda word: xp.sqrt(xp.log((_fraction(word, like) + 0.5) * _UNIT) * -2.0), (x, z)
    )
    angles = _each(lambda word: _fraction(word, like) * (2 * math.pi * _UNIT), (y, w))
    return (
        radius * along(angle)
        for along in (xp.cos, xp.sin)
        for radius, angle in zip(radii, angles, strict=True)
    )


def _fraction(word: Array, like: Array) -> Array:
    """Return the upper 24 bits of a word as a float: the bits of higher quality, as many as float32
    holds exactly.
    """
    bits = _shifted(word, 8)
    return cast(bits.view(np.int32) if isinstance(bits, np.ndarray) else bits, like.dtype)


def _shifted(word: Array, bits: int) -> Array:
    """Return a word after a logical right shift, which fills up with zeros."""
    return (
        word >> bits if isinstance(word, np.ndarray) else (word >> bits) & ((1 << (32 - bits)) - 1)
    )


def _each(function: Callable[[Array], Array], words: Words) -> list[Array]:
    """Return a function of each word. On NumPy one call serves all words, because calls are what
    costs time there.
    """
    if not isinstance(words[0], np.ndarray):
        return [function(word) for word in words]
    rows = len(words[0])
    all_at_once = function(np.concatenate(words))
    return [all_at_once[at : at + rows] for at in range(0, rows * len(words), rows)]
