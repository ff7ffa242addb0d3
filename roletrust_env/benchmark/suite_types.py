"""The kinds of suites: of which cells each consists, and how one of them is played.

Pools and the store know no more of a suite than this.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from roletrust_env.benchmark.cells import Cell, cells, named
from roletrust_env.benchmark.learners import contestants
from roletrust_env.benchmark.learners.run_trial import play_trial
from roletrust_env.benchmark.learners.suite import LearnersSuite, Trial, trials
from roletrust_env.benchmark.run_cell import play_cell
from roletrust_env.benchmark.schema import CellResult
from roletrust_env.benchmark.suite import Suite

AnySuite = Suite | LearnersSuite
AnyCell = Cell | Trial


class SuiteType(NamedTuple):
    """What there is to a kind of suite.

    Attributes:
        cell: makes a cell of its fields, by their names.
        cells: all cells of a suite.
        play: plays a cell of a suite.
        named: what makes all that a suite names, and others may write and change.
    """

    cell: Callable[..., AnyCell]
    cells: Callable[[Any], list[Any]]
    play: Callable[[Any, Any], CellResult]
    named: Callable[[Any], dict[str, Callable[..., Any]]]


_KINDS = {
    "robustness": SuiteType(Cell, cells, play_cell, named),
    "learners": SuiteType(Trial, trials, play_trial, contestants.named),
}


def suite_type(suite: AnySuite) -> SuiteType:
    """The kind of a suite."""
    return _KINDS[suite.kind]
