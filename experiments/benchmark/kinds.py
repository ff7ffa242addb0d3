"""The kinds of suites: of which cells each consists, and how one of them is played.

Pools and the store know no more of a suite than this.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from experiments.benchmark.cells import Cell, cells, named
from experiments.benchmark.learners import contestants
from experiments.benchmark.learners.suite import LearnersSuite, Trial, trials
from experiments.benchmark.learners.work import play_trial
from experiments.benchmark.suite import Suite
from experiments.benchmark.terms import Done
from experiments.benchmark.work import play_cell

AnySuite = Suite | LearnersSuite
AnyCell = Cell | Trial


class Kind(NamedTuple):
    """What there is to a kind of suite.

    Attributes:
        cell: makes a cell of its fields, by their names.
        cells: all cells of a suite.
        play: plays a cell of a suite.
        named: what makes all that a suite names, and others may write and change.
    """

    cell: Callable[..., AnyCell]
    cells: Callable[[Any], list[Any]]
    play: Callable[[Any, Any], Done]
    named: Callable[[Any], dict[str, Callable[..., Any]]]


_KINDS = {
    "robustness": Kind(Cell, cells, play_cell, named),
    "learners": Kind(Trial, trials, play_trial, contestants.named),
}


def kind_of(suite: AnySuite) -> Kind:
    """The kind of a suite."""
    return _KINDS[suite.kind]
