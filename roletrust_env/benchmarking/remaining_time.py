"""Estimate of the remaining time of a run, from the estimated cost of its cells and the time that passed."""

from collections.abc import Mapping, Sequence
from typing import Any, Self

from roletrust_env.benchmarking.cost_estimate import estimate_seconds
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_types import AnySuite
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.trust.model_checks import needs_watching

_STARTING = 0.02
"""Share of the cost below which the remaining time is unknown."""

_STANDS_IN = "role-trust"
"""Model whose trial stands in for that of a model of another package, which might hang outside a process of its own."""


class RemainingTime:
    """The remaining time of a run in progress.

    The cells of a run differ in cost by a factor of a thousand, so their number says little. Trials estimate the cost
    of each cell, and the cells that are finished show how much the trials err on this machine.

    Args:
        costs: Estimated cost of each cell to play by its key, in any unit.

    Example:
        >>> remaining = RemainingTime({"short": 1.0, "long": 9.0})
        >>> remaining.finish("short")
        >>> remaining.seconds(passed_s=2.0)
        18.0
    """

    def __init__(self, costs: Mapping[str, float]) -> None:
        self._costs = dict(costs)
        self._all = sum(self._costs.values())

    def finish(self, key: str) -> None:
        """Count a cell as finished; a cell that is finished already, or has no cost, changes nothing."""
        self._costs.pop(key, None)

    @classmethod
    def of(cls, suite: AnySuite, cells: Sequence[Any]) -> Self:
        """Return the remaining time of cells after short trials, which take some seconds.

        All trials of a learner count alike. Where a trial fails, as its cells will, the time stays unknown.

        Args:
            suite: Suite of the cells.
            cells: Cells to play.
        """
        if not isinstance(suite, Suite):
            return cls(dict.fromkeys((cell.key for cell in cells), 1.0))
        scenario = next(iter(suite.scenarios.values())).scenario()
        foreign = {name for name in {cell.model for cell in cells} if needs_watching(parse_trust_model(name, scenario))}
        tried = [cell._replace(model=_STANDS_IN) if cell.model in foreign else cell for cell in cells]
        try:
            seconds = estimate_seconds(suite, tried)
        except Exception:  # attacks of other packages may raise anything
            return cls({})
        return cls({cell.key: seconds[one.key] for cell, one in zip(cells, tried, strict=True)})

    @property
    def share(self) -> float:
        """Share of the estimated cost that is finished, in [0, 1]."""
        return 1.0 - self._left / self._all if self._all > 0 else 1.0

    @property
    def _left(self) -> float:
        return sum(self._costs.values())

    def seconds(self, passed_s: float) -> float | None:
        """Return the remaining time in seconds; None at the start, as long as processes start rather than play.

        Args:
            passed_s: Time since the start in seconds.
        """
        left = self._left
        finished = self._all - left
        return passed_s * left / finished if finished > _STARTING * self._all else None
