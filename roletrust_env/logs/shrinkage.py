"""Shrunken trust: the fewer raters an agent has, the nearer its estimate is to the mean of all."""

from typing import NamedTuple

from roletrust_env.trust.key_index import Floats, Ints


class Shrinkage(NamedTuple):
    """How trust is drawn towards a mean.

    Attributes:
        mean: Mean towards which trust is drawn, in [0, 1].
        weight: Number of raters by which it is drawn there; 0 leaves trust as it is.
    """

    mean: float = 0.5
    weight: float = 0.0

    def of(self, trust: Floats, raters: Floats | Ints) -> Floats:
        """Return the estimates of agents.

            s = (n T + w m) / (n + w)

        with n raters, the mean m and its weight w: the posterior mean of a quality with the
        variance v around m, of which each rating by another rater shows the quality with the
        variance w v (Efron and Morris, 1975).

        Example:
            >>> import numpy as np
            >>> Shrinkage(0.5, 2.0).of(np.array([1.0, 1.0]), np.array([2, 18])).tolist()
            [0.75, 0.95]

        Args:
            trust: Trust T, shape (n,), in [0, 1].
            raters: Number of raters of each agent, shape (n,), at least 0.
        """
        if not self.weight:
            return trust
        estimate: Floats = (raters * trust + self.weight * self.mean) / (raters + self.weight)
        return estimate
