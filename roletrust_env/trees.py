"""Nested tuples of arrays, such as the state of a game, of a trust model or of a policy: their leaves, and new ones."""

from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any, Literal, TypeAlias, cast, get_type_hints

from roletrust_env.arrays import Array

Kind: TypeAlias = Literal["rater", "provider", "pair", "age"]
"""What an entry of a field of a state is about, by the annotation of the field; an age is about a pair."""


def leaves(tree: Any) -> Iterator[Any]:
    """Iterate over what is in nested tuples and is no tuple, in order: arrays, numbers, flags and None."""
    if isinstance(tree, tuple):
        for part in tree:
            yield from leaves(part)
    else:
        yield tree


def is_array(leaf: Any) -> bool:
    """Return whether a leaf is an array or a number: neither None nor a flag of Python."""
    return leaf is not None and not isinstance(leaf, bool)


def arrays(tree: Any) -> list[Array]:
    """Return the leaves that are arrays or numbers, in order; see `is_array`."""
    return list(filter(is_array, leaves(tree)))


def map_leaves(change: Callable[..., Any], tree: Any, *others: Any) -> Any:
    """Return a tree of the same structure with other leaves.

    Args:
        change: Function of a leaf, and of the leaves of the other trees in the same place.
        tree: Nested tuples.
        *others: Further trees of the same structure.
    """
    if not isinstance(tree, tuple):
        return change(tree, *others)
    parts = [map_leaves(change, *branches) for branches in zip(tree, *others, strict=True)]
    return type(tree)(*parts) if hasattr(tree, "_fields") else tuple(parts)


def kinds(state: Any) -> Iterator[tuple[Kind, Array]]:
    """Iterate over the arrays of a state that are about agents or pairs, each with its kind, in order.

    Args:
        state: NamedTuple whose fields are annotated, see `roletrust_env.trust.ratings.PerRater`; it may hold further
            such states.
    """
    for kind, part in zip(_field_kinds(cast(Any, type(state))), state, strict=True):
        if kind is not None:
            yield kind, part
        elif hasattr(part, "_fields"):
            yield from kinds(part)


def map_kinds(change: Callable[..., Array], state: Any, *others: Any) -> Any:
    """Return a state whose arrays about agents or pairs are changed; all else, such as a flag, stays.

    Args:
        change: Function of the kind and of the array, and of the arrays of the other states in the same place.
        state: State, see `kinds`.
        *others: Further states of the same type.
    """
    parts, cls = [], cast(Any, type(state))
    for kind, part, *same in zip(_field_kinds(cls), state, *others, strict=True):
        if kind is not None:
            part = change(kind, part, *same)
        elif hasattr(part, "_fields"):
            part = map_kinds(change, part, *same)
        parts.append(part)
    return cls(*parts)


@lru_cache(maxsize=64)
def _field_kinds(cls: Any) -> tuple[Kind | None, ...]:
    """Return the kind of each field of a type of state; None for a field that is about no agent or pair."""
    hints = get_type_hints(cls, include_extras=True)
    return tuple(next(iter(getattr(hints[name], "__metadata__", ())), None) for name in cls._fields)
