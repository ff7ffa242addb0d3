"""Nested tuples of arrays: what is in them, and what of it is about agents or pairs."""

from typing import Any, NamedTuple

import numpy as np
from refusals import refuses

from roletrust_env.shapes import PairAge, PerRater
from roletrust_env.trees import arrays, check_ranges, kinds, leaves, map_kinds, map_leaves


class Inner(NamedTuple):
    """Ages, and something that is about nobody."""

    age: PairAge
    other: Any = None


class Outer(NamedTuple):
    """A state with a state in it."""

    tor: PerRater
    flag: Any
    inner: Inner
    parts: tuple[Any, ...]


ONE = Outer(np.zeros(2), 1.0, Inner(np.zeros(3)), (4.0, None))


def test_leaves_come_in_order_and_arrays_leave_out_none():
    assert list(leaves(ONE)) == [ONE.tor, 1.0, ONE.inner.age, None, 4.0, None]
    assert arrays(ONE) == [ONE.tor, 1.0, ONE.inner.age, 4.0]


def test_a_mapped_tree_has_the_same_structure():
    other = map_leaves(lambda leaf: (leaf,) and 1, ONE)
    assert other == Outer(1, 1, Inner(1, None), (1, None))
    assert map_leaves(lambda a, b: (a, b), other, map_leaves(lambda _: 2, ONE)).inner == Inner(
        (1, 2), None
    )
    with refuses(ValueError, "2"):
        map_leaves(lambda a, b: a, ONE, ONE[:2])


def test_kinds_are_those_of_the_annotations():
    assert [(kind, len(leaf)) for kind, leaf in kinds(ONE)] == [("rater", 2), ("age", 3)]
    mapped = map_kinds(lambda kind, leaf, same: (kind, len(leaf) + len(same)), ONE, ONE)
    assert mapped == Outer(("rater", 4), 1.0, Inner(("age", 6)), (4.0, None))


def test_ranges_are_those_of_the_annotations_and_states_without_any_have_none():
    for state in (
        ONE,
        ONE._replace(inner=Inner(np.array([0, 3]))),
        (np.array([-1.0]),),
        np.array([-1.0]),
        (),
    ):
        check_ranges(state, 2)
    with refuses(ValueError, "4.0", "[0, 3]"):
        check_ranges(ONE._replace(inner=Inner(np.array([0.0, 4.0]))), 2)
