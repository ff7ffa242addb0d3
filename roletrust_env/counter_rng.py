"""Random numbers as a function of where they are used: of the cell, of the game and of a key.

There is no state to carry along, so that a number does not depend on how many others are made with it: a game has the
same luck alone and in a batch, on NumPy and on torch, in either precision, and a compiler can make the numbers where
they are used. The hash is pcg4d (Jarzynski and Olano 2020, "Hash Functions for GPU Rendering", JCGT 9 (3)), which
turns four words of 32 bits into four others. A word is uint32 on NumPy and int32 elsewhere, where uint32 is missing.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import islice

import numpy as np

from roletrust_env.arrays import Array, namespace

Words = Sequence[Array]
"""Four arrays of words (no single numbers: their arithmetic would warn), of shapes that can be broadcast."""

_MULTIPLIER, _INCREMENT = 1664525, 1013904223  # of the linear congruential generator in Numerical Recipes
BLOCK = 32_768
"""Hashes that NumPy makes at once: fewer cost as many calls, and of more what lies in between leaves the cache."""

_UNIT = 2.0**-24


def whole(like: Array, count: int) -> Array:
    """The words 0, 1, ..., count - 1, on the library and device of `like`."""
    xp = namespace(like)
    return xp.arange(count, dtype=xp.uint32 if xp is np else xp.int32, device=like.device)


def scramble(words: Words) -> list[Array]:
    """Four words that look as if they had nothing to do with these four."""
    mixed = _mix(*(word * _MULTIPLIER + _INCREMENT for word in words))
    return _mix(*_each(lambda word: word ^ _shifted(word, 16), mixed))


def uniform(like: Array, cells: int, games: Array, key: Words) -> Array:
    """Numbers from U[0, 1), multiples of 2 ** -24.

    Args:
        like: an array of the library, dtype and device to work with.
        cells: number of cells, C.
        games: the games' numbers, words of shape (E,).
        key: four words, of shape (1,), or of shape (E,) where every game has a key of its own.

    Returns:
        Shape (C, E), in the dtype of `like`.
    """
    return _made(like, cells, games, key, _uniforms)


def normal(like: Array, cells: int, games: Array, key: Words) -> Array:
    """Numbers from N(0, 1), after Box and Muller (1958), at most 5.9 from 0. Arguments as for `uniform`."""
    return _made(like, cells, games, key, _normals)


def _mix(x: Array, y: Array, z: Array, w: Array) -> list[Array]:
    x = x + y * w
    y = y + z * x
    z = z + x * y
    return [x, y, z, w + y * z]


def _made(
    like: Array, cells: int, games: Array, key: Words, numbers: Callable[[Words, Array], Iterable[Array]]
) -> Array:
    """Numbers for all cells and games: four of them come of one scrambling, each in a quarter of the cells."""
    groups = whole(like, -(-cells // 4))[:, None]
    needed = -(-cells // max(1, len(groups)))  # of the quarters: 3 for 9 cells

    def quarters(groups: Array, games: Array, key: Words) -> list[Array]:
        return list(islice(numbers(scramble((groups + key[0], games + key[1], key[2], key[3])), like), needed))

    if not isinstance(like, np.ndarray) or groups.size * games.size <= BLOCK:
        return namespace(like).concat(quarters(groups, games, key))[:cells]
    made = np.empty((needed, groups.size, games.size), like.dtype)
    wide = min(games.size, BLOCK)
    for some in _slices(games.size, wide):
        keys = [word if word.shape == (1,) else word[some] for word in key]
        for rows in _slices(groups.size, max(1, BLOCK // wide)):
            made[:, rows, some] = quarters(groups[rows], games[some], keys)
    return made.reshape(-1, games.size)[:cells]


def _slices(total: int, step: int) -> list[slice]:
    return [slice(at, at + step) for at in range(0, total, step)]


def _uniforms(words: Words, like: Array) -> list[Array]:
    return _each(lambda word: _fraction(word, like) * _UNIT, words)


def _normals(words: Words, like: Array) -> Iterable[Array]:
    xp, (x, y, z, w) = namespace(like), words
    radii = _each(lambda word: xp.sqrt(xp.log((_fraction(word, like) + 0.5) * _UNIT) * -2.0), (x, z))
    angles = _each(lambda word: _fraction(word, like) * (2 * math.pi * _UNIT), (y, w))
    return (radius * along(angle) for along in (xp.cos, xp.sin) for radius, angle in zip(radii, angles, strict=True))


def _fraction(word: Array, like: Array) -> Array:
    """The upper 24 bits of a word, which are the better ones, and as many as float32 holds exactly."""
    bits = _shifted(word, 8)
    return bits.view(np.int32).astype(like.dtype) if isinstance(bits, np.ndarray) else bits.to(like.dtype)


def _shifted(word: Array, bits: int) -> Array:
    """A word moved down, with zeros from above."""
    return word >> bits if isinstance(word, np.ndarray) else (word >> bits) & ((1 << (32 - bits)) - 1)


def _each(function: Callable[[Array], Array], words: Words) -> list[Array]:
    """A function of each word: for NumPy all in one call, since it pays for calls, and a compiler for arrays."""
    if not isinstance(words[0], np.ndarray):
        return [function(word) for word in words]
    rows = len(words[0])
    all_at_once = function(np.concatenate(words))
    return [all_at_once[at : at + rows] for at in range(0, rows * len(words), rows)]
