"""The types of suites. Each type defines the cells of a suite and how a cell is played.

Pools and the store use no other knowledge of a suite.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from roletrust_env.benchmarking.cells import Cell, cells, factories, rules
from roletrust_env.benchmarking.learners import search_methods
from roletrust_env.benchmarking.learners.run_trial import play_trial
from roletrust_env.benchmarking.learners.suite import LearnersSuite, Trial, trials
from roletrust_env.benchmarking.run_cell import play_cell
from roletrust_env.benchmarking.schema import CellResult
from roletrust_env.benchmarking.suite import Suite

AnySuite = Suite | LearnersSuite
AnyCell = Cell | Trial


class SuiteType(NamedTuple):
    """Functions that define a type of suite.

    Attributes:
        cell: Constructor of a cell. It takes the fields of the cell as keyword arguments.
        cells: Function that returns all cells of a suite.
        play: Function that plays a cell of a suite. That of a robustness suite has more arguments.
        factories: Function that returns the factories of everything that a suite names and users may replace.
        rules: Function that returns all fields of a suite that the result of a cell depends on.
    """

    cell: Callable[..., AnyCell]
    cells: Callable[[Any], list[Any]]
    play: Callable[..., CellResult]
    factories: Callable[[Any], dict[str, Callable[..., Any]]]
    rules: Callable[[Any, Any], object]


_TYPES = {
    "robustness": SuiteType(Cell, cells, play_cell, factories, rules),
    "learners": SuiteType(Trial, trials, play_trial, search_methods.factories, lambda suite, _: suite),
}


def suite_type(suite: AnySuite) -> SuiteType:
    """Return the type of a suite."""
    return _TYPES[suite.kind]
