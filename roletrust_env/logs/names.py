"""Names of agents by place, as they arrive."""

from collections.abc import Iterator, Sequence
from copy import copy, deepcopy
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import numpy_array
from roletrust_env.errors import short
from roletrust_env.logs.values import LONGEST, trimmed
from roletrust_env.trust.key_index import Ints, KeyIndex

Names: TypeAlias = npt.NDArray[Any]
"""Names as whole numbers, of type int64, or as texts, of type object."""


class NameList(Sequence[Any]):
    """Names in a column of pyarrow, which takes a tenth of the memory of a list, and of the time to
    sort it.
    """

    def __init__(self, column: Any) -> None:
        self.column = column

    @classmethod
    def of(cls, names: Sequence[str]) -> "NameList":
        """Return names as such a list."""
        import pyarrow as arrow

        return names if isinstance(names, NameList) else cls(arrow.array(names))

    def __len__(self) -> int:
        """Return the number of names."""
        return len(self.column)

    def __getitem__(self, place: Any) -> Any:
        """Return the name at a place."""
        return self.column[place].as_py()

    def __iter__(self) -> Iterator[Any]:
        """Iterate over the names."""
        return iter(self.column.to_pylist())

    def __eq__(self, other: object) -> bool:
        """Return whether there are the same names in the same order."""
        return isinstance(other, Sequence) and list(self) == list(other)

    def __arrow_array__(self, type: Any = None) -> Any:
        """Return the column."""
        return self.column

    def texts(self, places: Any) -> Names:
        """Return the names at some places as an array of objects."""
        return np.array(list(self.at(places)), object)

    def at(self, places: Any) -> "NameList":
        """Return the names at some places."""
        return NameList(self.column.take(np.asarray(places, np.int64)))


class NameIndex:
    """Places of names. All names are whole numbers, or all are texts.

    Attributes:
        role: Plural of the role, such as `raters`, for messages.
    """

    def __init__(self, role: str) -> None:
        self.role = role
        self._numbers: KeyIndex | None = None
        self._first: NameList | None = None  # a dict of them is made when a name is looked up
        self._known: dict[str, int] | None = None

    @property
    def _texts(self) -> dict[str, int] | None:
        if self._first is not None:
            self._known = dict(zip(self._first, range(len(self._first)), strict=True))
            self._first = None
        return self._known

    def __len__(self) -> int:
        """Return the number of names."""
        return len(self._first or self._numbers or self._known or ())

    def begin(self, names: Any) -> None:
        """Give places to the first names; those of a log are known to be different texts."""
        if isinstance(names, NameList) and not len(self):
            self._first = names
        else:
            self.places(self.check(names))

    def __deepcopy__(self, memo: dict[int, Any]) -> "NameIndex":
        """Return a copy; names never change."""
        other = copy(self)
        other._numbers, other._known = deepcopy(self._numbers, memo), copy(self._known)
        return other

    @property
    def names(self) -> Sequence[Any]:
        """The names, by place."""
        return self.stored().tolist() if self._first is None else self._first

    def stored(self) -> Names:
        """Return the names by place, shape (n,), for `restore`."""
        if self._numbers is not None:
            return self._numbers.keys
        texts = self._first or self._known
        return np.zeros(0, np.int64) if texts is None else np.array(list(texts), object)

    def check(self, names: Any) -> Names:
        """Return names as an array, shape (n,); the index is not changed.

        Raises:
            ValueError: Something else is there, or texts where numbers were and the reverse.
        """
        if isinstance(names, str | bytes):
            raise ValueError(
                f"{self.role} are {short(repr(names))}; they must be a column of names, also for "
                "one name"
            )
        array = numpy_array(f"the column of {self.role}", names, "whole numbers or texts")
        if array.dtype.kind == "U" and not isinstance(names, np.ndarray):
            array = np.array(list(names), object)  # NumPy's own texts lose a NUL at the end
        if array.ndim != 1:
            raise ValueError(f"{self.role} have shape {array.shape}; they must be one column")
        if not len(array):
            return np.zeros(0, np.int64)
        if array.dtype.kind == "i" or (array.dtype.kind == "u" and array.max() < 2**63):
            kind, array = "whole numbers", array.astype(np.int64, copy=False)
        elif array.dtype.kind in "OUT" and all(
            issubclass(kind, str) for kind in set(map(type, array.tolist()))
        ):
            kind, array = "texts", np.array(self._trimmed(array.tolist()), object)
        else:
            raise ValueError(
                f"{self.role} are of type {array.dtype}; they must be whole numbers or texts"
            )
        before = (
            "whole numbers"
            if self._numbers is not None
            else "texts"
            if self._first is not None or self._known is not None
            else kind
        )
        if kind != before:
            raise ValueError(f"{self.role} are {kind}; they were {before} before")
        return array

    def _trimmed(self, names: list[str]) -> list[str]:
        """Return texts as names.

        Raises:
            ValueError: One is no name in a file, either.
        """
        names = [trimmed(name) for name in names]
        for place, name in enumerate(names, 1):
            try:
                size = len(name.encode())
            except UnicodeEncodeError:  # half a letter
                size = 0
            if not 0 < size <= LONGEST:
                raise ValueError(
                    f"{self.role} have {name[:20]!r} at position {place}; a name has 1 to "
                    f"{LONGEST:,} bytes"
                )
        return names

    def expect(self, names: Names) -> None:
        """Let all names be of the type of these, which get no place yet."""
        if names.dtype == object:
            self._known = self._texts or {}
        else:
            self._numbers = self._numbers or KeyIndex()

    def places(self, names: Names) -> Ints:
        """Return the places of names, as `check` returns them; unknown ones are added."""
        if not len(names):
            return np.zeros(0, np.int64)
        self.expect(names)
        if self._numbers is not None:
            return self._numbers.places(names)
        known = {} if self._texts is None else self._texts
        return np.array([known.setdefault(name, len(known)) for name in names.tolist()])

    def restore(self, names: Names) -> None:
        """Take names as they were, by place; without names, both types are welcome again.

        Raises:
            ValueError: A name occurs twice.
        """
        self._numbers = self._known = self._first = None
        if not len(names):
            return
        if names.dtype != object:
            self._numbers = KeyIndex.of(names)
            return
        self._known = dict(zip(names.tolist(), range(len(names)), strict=True))
        if len(self._known) < len(names):
            raise ValueError("a name occurs twice")
