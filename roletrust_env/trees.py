"""Nested tuples of arrays, such as the state of a game, of a trust model or of a policy: their
leaves, and new ones.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from typing import Any, Literal, NamedTuple, TypeAlias, cast, get_type_hints

import numpy as np

from roletrust_env.arrays import Array

Kind: TypeAlias = Literal["rater", "provider", "pair", "age"]
"""What an entry of a field of a state is about, by the annotation of the field; an age is about a
pair."""


@dataclass(frozen=True)
class ValueRange:
    """Annotation of a field of a state: the range of its values, both ends included. Others hold
    any finite values.

    Attributes:
        low: Least value.
        high: Largest value, or the name of a field of the same state that has the largest value in
            each place.
        whole: Whether the values are whole numbers.
    """

    low: float = -inf
    high: float | str = inf
    whole: bool = False

    def __str__(self) -> str:
        """Return what is allowed, in words."""
        return f"{'be whole and ' if self.whole else ''}lie in [{self.low:g}, {self.high}]"


_MOST = 2.0**53  # whole numbers up to it are exact in float64

SHARES, SIGNED = ValueRange(0, 1), ValueRange(-1, 1)
AMOUNTS, BALANCES, POSITIVE = (
    ValueRange(0, _MOST),
    ValueRange(-_MOST, _MOST),
    ValueRange(1e-9, _MOST),
)
COUNTS, FLAGS = ValueRange(0, _MOST, whole=True), ValueRange(0, 1, whole=True)


def leaves(tree: Any) -> Iterator[Any]:
    """Iterate over the leaves of nested tuples, in order: arrays, and None for unused parts."""
    if isinstance(tree, tuple):
        for part in tree:
            yield from leaves(part)
    else:
        yield tree


def arrays(tree: Any) -> list[Array]:
    """Return the arrays of a tree, in order."""
    return [leaf for leaf in leaves(tree) if leaf is not None]


def map_leaves(change: Callable[..., Any], tree: Any, *others: Any) -> Any:
    """Return a tree of the same structure with other leaves; None stays None.

    Args:
        change: Function of an array, and of the arrays of the other trees in the same place.
        tree: Nested tuples.
        *others: Further trees of the same structure.
    """
    if tree is None:
        return None
    if not isinstance(tree, tuple):
        return change(tree, *others)
    parts = [map_leaves(change, *branches) for branches in zip(tree, *others, strict=True)]
    return type(tree)(*parts) if hasattr(tree, "_fields") else tuple(parts)


def kinds(state: Any) -> Iterator[tuple[Kind, Array]]:
    """Iterate over the arrays of a state that are about agents or pairs, each with its kind, in
    order.

    Args:
        state: NamedTuple whose fields are annotated, see `roletrust_env.shapes.PerRater`; it
            may hold further such states.
    """
    for (kind, _), part in zip(_marks(cast(Any, type(state))), state, strict=True):
        if kind is not None:
            yield kind, part
        elif hasattr(part, "_fields"):
            yield from kinds(part)


def map_kinds(change: Callable[..., Array], state: Any, *others: Any) -> Any:
    """Return a state whose arrays about agents or pairs are changed; all else stays.

    Args:
        change: Function of the kind and of the array, and of the arrays of the other states in the
            same place.
        state: State, see `kinds`.
        *others: Further states of the same type.
    """
    parts, cls = [], cast(Any, type(state))
    for (kind, _), part, *same in zip(_marks(cls), state, *others, strict=True):
        if kind is not None:
            part = change(kind, part, *same)
        elif hasattr(part, "_fields"):
            part = map_kinds(change, part, *same)
        parts.append(part)
    return cls(*parts)


def check_ranges(state: Any, rounds: int) -> None:
    """Refuse a state of NumPy with values that its annotations do not allow, see `ValueRange`.

    Args:
        state: State, see `kinds`; it may have annotations or none.
        rounds: Number of rounds so far, which no age exceeds.

    Raises:
        ValueError: A value is outside its range. The message names the field.
    """
    if not hasattr(state, "_fields"):
        return
    try:
        marks = _marks(cast(Any, type(state)))
    except NameError:  # an annotation that is known to type checkers alone
        return
    for name, (kind, allowed), part in zip(state._fields, marks, state, strict=True):
        if kind == "age":
            allowed = ValueRange(0, rounds + 1, whole=True)
        if allowed is not None:
            high = getattr(state, allowed.high) if isinstance(allowed.high, str) else allowed.high
            values = np.asarray(part)
            wrong = ~(
                (values >= allowed.low)
                & (values <= high)
                & (not allowed.whole or np.rint(values) == values)
            )
            if wrong.any():
                raise ValueError(
                    f"{name} of {type(state).__name__} is {values[wrong][0]}; it must {allowed}"
                )
        else:
            check_ranges(part, rounds)


class _Marks(NamedTuple):
    """Content of the annotation of a field: what an entry is about, and the range; None where it
    does not say it.
    """

    kind: Kind | None
    allowed: ValueRange | None


@lru_cache(maxsize=64)
def _marks(cls: Any) -> tuple[_Marks, ...]:
    """Return the marks of each field of a type of state."""
    hints = get_type_hints(cls, include_extras=True)
    notes = [getattr(hints[name], "__metadata__", ()) for name in cls._fields]
    return tuple(_Marks(_first(str, every), _first(ValueRange, every)) for every in notes)


def _first(kind: type, notes: tuple[Any, ...]) -> Any:
    return next((note for note in notes if isinstance(note, kind)), None)
