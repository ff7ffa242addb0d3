"""Promised speeds."""

from typing import NamedTuple

from studies.timing.contestants import Spread


class Target(NamedTuple):
    """A promised speed and the measured one; `found` is None if one side of the comparison was not measured."""

    what: str
    bound: float
    at_least: bool
    found: Spread | None

    @property
    def ok(self) -> bool | None:
        """True if the median keeps the promise; None if nothing was measured."""
        if self.found is None:
            return None
        return self.found.median >= self.bound if self.at_least else self.found.median <= self.bound
