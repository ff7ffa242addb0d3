"""A table from whole numbers to consecutive places, for a million keys at a time."""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from roletrust_env.shapes import Shape

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

_FACTOR = np.uint64(0x9E3779B97F4A7C15)  # 2^64 over the golden ratio: neighbours fall far apart
_LOAD = 0.25  # share of the hash table that is used at most: few keys wait for their place
_BLOCK = 1 << 16  # keys at a time
_SPARE, _SMALL = (
    8,
    1 << 20,
)  # entries per key, and the size in any case, up to which keys are their own entries


class KeyIndex:
    """Places 0, 1, 2, ... of whole numbers; those of an earlier call have earlier places. At most
    2^31 - 1 keys.

    Keys from 0 to a few times their number, such as the numbers of members, are entries of a table
    themselves, and their places are in the order in which they first occur. Other keys are in a
    hash table with open addressing. The steps of both are operations on arrays, where a dict would
    take a step of Python for each key.

    Example:
        >>> index = KeyIndex()
        >>> index.places(np.array([70])), index.places(np.array([90, 70, 90])), index.places(np.array([5]), add=False)
        (array([0]), array([1, 0, 1]), array([-1]))
    """  # noqa: E501

    def __init__(self) -> None:
        self._keys: Ints = np.zeros(1 << 10, np.int64)
        self._count = 0
        self._size = 1 << 10
        self._direct = True  # whether a key is its own entry
        self._allocate(self._size)

    @classmethod
    def of(cls, keys: Ints) -> "KeyIndex":
        """Return an index that has distinct keys at places in their order.

        Raises:
            ValueError: A key occurs twice.
        """
        index = cls()
        ordered = np.sort(keys)  # unique takes ten times as long
        if (ordered[1:] == ordered[:-1]).any():
            raise ValueError("a key occurs twice")
        if len(keys):
            index._make_room(np.asarray(keys, np.int64))
            index._keys, index._count = np.array(keys, np.int64), len(keys)
            index._fill()
        return index

    def __len__(self) -> int:
        """Return the number of keys."""
        return self._count

    @property
    def keys(self) -> Ints:
        """The keys, by place."""
        return self._keys[: self._count]

    def places(
        self, keys: Annotated[Ints, Shape("n", "whole")], *, add: bool = True
    ) -> Annotated[Ints, Shape("n", "whole")]:
        """Return the place of each key, shape (n,).

        Args:
            keys: Keys, whole, shape (n,).
            add: Whether an unknown key is added; otherwise its place is -1.
        """
        keys = np.ascontiguousarray(keys, np.int64)
        parts = [
            self._block_places(keys[at : at + _BLOCK], add) for at in range(0, len(keys), _BLOCK)
        ]
        return parts[0] if len(parts) == 1 else np.concatenate([*parts, np.empty(0, np.int64)])

    def _block_places(self, keys: Ints, add: bool) -> Ints:
        """Return the places of so few keys, at least one, that room for all of them may be made."""
        if add:
            self._make_room(keys)
        places, where = self._find(keys, self._first_entries(keys))
        while add and len(
            waiting := (places < 0).nonzero()[0]
        ):  # again where another key took the entry
            rest, vacant = keys.take(waiting), where.take(waiting)
            self._add(rest, vacant)
            places[waiting], where[waiting] = self._find(rest, vacant)
        return places

    def _find(self, keys: Ints, where: Ints) -> tuple[Ints, Ints]:
        """Return the place of each key, -1 if unknown, and the entry of that place, which is vacant
        if unknown.

        Args:
            keys: Keys, shape (n,).
            where: Entry at which the search for each key begins.
        """
        places = self._entries.take(where).astype(np.int64)
        if self._direct:
            return places, where
        on = ((self._keys.take(places) != keys) & (places >= 0)).nonzero()[0]
        keys, where, at = keys.take(on), where.copy(), where.take(on)
        while len(on):
            at = (at + 1) & (self._size - 1)
            candidates = self._entries.take(at)
            places[on], where[on] = candidates, at
            more = ((self._keys.take(candidates) != keys) & (candidates >= 0)).nonzero()[0]
            on, keys, at = on.take(more), keys.take(more), at.take(more)
        return places, where

    def _add(self, keys: Ints, where: Ints) -> None:
        """Put keys into vacant entries; of several keys for one entry, the first."""
        turn = np.arange(len(keys), dtype=np.int32)
        self._entries[where[::-1]] = turn[::-1]  # the last assignment to an entry stays
        chosen = (self._entries.take(where) == turn).nonzero()[0]  # every entry once
        before, after = self._count, self._count + len(chosen)
        self._entries[where.take(chosen)] = np.arange(before, after)
        if after > len(self._keys):
            self._keys = np.concatenate(
                [self._keys, np.zeros(max(after, len(self._keys)), np.int64)]
            )
        self._keys[before:after] = keys.take(chosen)
        self._count = after

    def _make_room(self, keys: Ints) -> None:
        """Make the table large enough for more keys. Once they are too far apart to be entries,
        they are hashed.
        """
        size, count = self._size, self._count + len(keys)
        if self._direct:
            last = int(keys.view(np.uint64).max())  # keys below 0 are the largest
            if last < max(_SMALL, _SPARE * count):
                self._resize(max(size, 1 << last.bit_length()))
                return
            self._direct, self._size, size = False, 0, 1 << 10
        while count > _LOAD * size:
            size *= 2
        self._resize(size)

    def _resize(self, size: int) -> None:
        if size != self._size:
            self._allocate(size)
            self._fill()

    def _allocate(self, size: int) -> None:
        self._size = size
        self._shift = np.uint64(64 - size.bit_length() + 1)
        self._entries = np.full(size + 1, -1, np.int32)  # the last one stays vacant

    def _fill(self) -> None:
        """Put the keys into an empty table that has room."""
        waiting, where = np.arange(self._count, dtype=np.int32), self._first_entries(self.keys)
        while len(waiting):
            free = (self._entries.take(where) < 0).nonzero()[0]
            self._entries[where.take(free)] = waiting.take(free)
            lost = (self._entries.take(where) != waiting).nonzero()[0]
            waiting, where = waiting.take(lost), (where.take(lost) + 1) & (self._size - 1)

    def _first_entries(self, keys: Ints) -> Ints:
        """Return the entry at which the search for each key begins."""
        numbers = keys.view(np.uint64)
        if self._direct:
            return np.minimum(numbers, np.uint64(self._size)).view(np.int64)
        return ((numbers * _FACTOR) >> self._shift).view(np.int64)
