"""Agents by name or by number, and their places 0, 1, 2, ..."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.trust.key_index import Ints, KeyIndex


class NameIndex:
    """Places of names. All names are whole numbers, or all are texts.

    Attributes:
        role: Plural of the role, such as `raters`, for messages.
    """

    def __init__(self, role: str) -> None:
        self.role = role
        self._numbers: KeyIndex | None = None
        self._texts: dict[str, int] | None = None

    def __len__(self) -> int:
        """Return the number of names."""
        return len(self._numbers or self._texts or ())

    @property
    def names(self) -> list[Any]:
        """The names, by place."""
        return list(self._texts) if self._texts is not None else self.numbers.tolist()

    @property
    def numbers(self) -> Ints:
        """The names that are whole numbers, by place; empty if names are texts."""
        return np.zeros(0, np.int64) if self._numbers is None else self._numbers.keys

    def check(self, names: Any) -> npt.NDArray[Any]:
        """Return names as an array, shape (n,), of whole numbers or of texts; the index is not changed.

        Raises:
            ValueError: Something else is there, or texts where numbers were and the reverse.
        """
        array = np.asarray(names)
        if array.ndim != 1:
            raise ValueError(f"{self.role} have shape {array.shape}; they must be one column")
        if not len(array):
            return array
        if array.dtype.kind in "iu" and array.max() < 2**63:
            kind = "whole numbers"
        elif array.dtype.kind in "OUT" and all(isinstance(name, str) for name in array.tolist()):
            kind = "texts"
        else:
            raise ValueError(f"{self.role} are of type {array.dtype}; they must be whole numbers or texts")
        before = "whole numbers" if self._numbers is not None else "texts" if self._texts is not None else kind
        if kind != before:
            raise ValueError(f"{self.role} are {kind}; they were {before} before")
        return array

    def places(self, names: npt.NDArray[Any], *, add: bool = True) -> Ints:
        """Return the places of names, as `check` returns them; unknown ones are added, or have the place -1."""
        if not len(names):
            return np.zeros(0, np.int64)
        if names.dtype.kind in "iu":
            index = self._numbers or KeyIndex()
            if add:
                self._numbers = index
            return index.places(names.astype(np.int64, copy=False), add=add)
        known = {} if self._texts is None else self._texts
        if not add:
            return np.array([known.get(name, -1) for name in names.tolist()])
        self._texts = known
        return np.array([known.setdefault(name, len(known)) for name in names.tolist()])

    def leaving(self, names: Any) -> Ints:
        """Return the places of names that are all known, each once.

        Raises:
            ValueError: A name is unknown, or has the wrong type.
        """
        array = self.check(names)
        places = self.places(array, add=False) if len(self) else np.full(len(array), -1)
        if (unknown := np.flatnonzero(places < 0)).size:
            raise ValueError(f"{array[unknown[0]]!s} is not among the {self.role}")
        return np.unique(places)

    def keep(self, stay: npt.NDArray[np.bool_]) -> None:
        """Keep some of the names, in their order; `stay` has a flag for each place."""
        if self._texts is not None:
            self.restore(self.numbers, [name for name, flag in zip(self._texts, stay.tolist(), strict=True) if flag])
        elif self._numbers is not None:
            self.restore(self.numbers[stay], None)

    def restore(self, numbers: Ints, texts: Sequence[str] | None) -> None:
        """Take names as they were, by place.

        Raises:
            ValueError: A name occurs twice.
        """
        self._texts = None
        if not texts:  # without agents, both kinds of names are welcome
            self._numbers = KeyIndex.of(numbers) if len(numbers) else None
            return
        self._texts = {name: place for place, name in enumerate(texts)}
        if len(self._texts) < len(texts):
            raise ValueError("a name occurs twice")
