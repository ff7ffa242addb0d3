"""A table from whole numbers to consecutive places, for a million keys at a time."""

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]

_EMPTY = np.iinfo(np.int64).min
_FACTOR = np.uint64(0x9E3779B97F4A7C15)  # 2^64 over the golden ratio: neighbours fall far apart
_LOAD = 0.5  # share of the table that is used at most
_BLOCK = 1 << 16  # keys at a time


class KeyIndex:
    """Places 0, 1, 2, ... of whole numbers; those that come earlier have earlier places.

    A hash table with open addressing, whose steps are operations on arrays. A dict would take a step of Python for each
    key.

    Example:
        >>> index = KeyIndex()
        >>> index.places(np.array([70])), index.places(np.array([90, 70, 90])), index.places(np.array([5]), add=False)
        (array([0]), array([1, 0, 1]), array([-1]))
    """

    def __init__(self) -> None:
        self._keys: Ints = np.empty(0, np.int64)
        self._count = 0
        self._allocate(1 << 10)

    @classmethod
    def of(cls, keys: Ints) -> "KeyIndex":
        """Return an index that has distinct keys at places in their order.

        Raises:
            ValueError: A key occurs twice.
        """
        index = cls()
        index._keys, index._count = np.array(keys, np.int64), len(keys)
        if len(np.unique(index._keys)) < len(keys):
            raise ValueError("a key occurs twice")
        index._reserve(len(keys), refill=True)
        return index

    def __len__(self) -> int:
        """Return the number of keys."""
        return self._count

    @property
    def keys(self) -> Ints:
        """The keys, by place."""
        return self._keys[: self._count]

    def places(self, keys: Ints, *, add: bool = True) -> Ints:
        """Return the place of each key, shape (n,).

        Args:
            keys: Keys, whole, shape (n,), each above -2^63.
            add: Whether an unknown key is added; otherwise its place is -1.
        """
        keys = np.ascontiguousarray(keys, np.int64)
        parts = [self._some_places(keys[at : at + _BLOCK], add) for at in range(0, len(keys), _BLOCK)]
        return parts[0] if len(parts) == 1 else np.concatenate([*parts, np.empty(0, np.int64)])

    def _some_places(self, keys: Ints, add: bool) -> Ints:
        """Return the places of so few keys that room for all of them may be made."""
        if add:
            self._reserve(self._count + len(keys))
        found = np.full(len(keys), -1, np.int64)
        waiting, where = np.arange(len(keys)), self._hash(keys)
        while len(waiting):
            wanted, there = keys[waiting], self._table[where]
            vacant = there == _EMPTY
            if add and vacant.any():
                self._add(wanted[vacant], where[vacant])
                there = self._table[where]
                vacant = there == _EMPTY
            same = there == wanted
            found[waiting[same]] = self._places[where[same]]
            on = ~(same | vacant)  # an unknown key ends at a vacant entry
            waiting, where = waiting[on], (where[on] + 1) & (len(self._table) - 1)
        return found

    def _add(self, keys: Ints, where: Ints) -> None:
        """Put each key into its vacant entry; of several keys for one entry, the last."""
        self._table[where] = keys
        turn = np.arange(len(keys))
        self._places[where] = turn
        chosen = where[self._places[where] == turn]  # every entry once
        new = len(chosen)
        self._places[chosen] = np.arange(self._count, self._count + new)
        if self._count + new > len(self._keys):
            self._keys = np.concatenate([self._keys, np.empty(max(new, len(self._keys)), np.int64)])
        self._keys[self._count : self._count + new] = self._table[chosen]
        self._count += new

    def _reserve(self, count: int, refill: bool = False) -> None:
        """Make the table large enough for so many keys; fill it again if it grows, or in any case."""
        size = len(self._table)
        while count > _LOAD * size:
            size *= 2
        if refill or size > len(self._table):
            self._allocate(size)
            self._insert_distinct(self.keys)

    def _insert_distinct(self, keys: Ints) -> None:
        """Put distinct keys into an empty table that has room, at places in their order."""
        waiting, where = np.arange(len(keys)), self._hash(keys)
        while len(waiting):
            free = self._table[where] == _EMPTY
            self._table[where[free]] = keys[waiting[free]]
            there = self._table[where] == keys[waiting]
            self._places[where[there]] = waiting[there]
            waiting, where = waiting[~there], (where[~there] + 1) & (len(self._table) - 1)

    def _allocate(self, size: int) -> None:
        self._table: Ints = np.full(size, _EMPTY, np.int64)
        self._places: Ints = np.zeros(size, np.int64)
        self._shift = np.uint64(64 - size.bit_length() + 1)

    def _hash(self, keys: Ints) -> Ints:
        return ((keys.view(np.uint64) * _FACTOR) >> self._shift).view(np.int64)
