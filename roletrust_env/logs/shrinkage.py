"""Shrunken trust: the fewer raters an agent has, the nearer its estimate is to the mean of all."""

from typing import NamedTuple

import numpy as np

from roletrust_env.logs.log import Log
from roletrust_env.metrics.score import ratio
from roletrust_env.trust.key_index import Floats, Ints


class Shrinkage(NamedTuple):
    """How trust is drawn towards a mean.

    Attributes:
        mean: Mean towards which trust is drawn, in [0, 1].
        weight: Number of raters by which it is drawn there; 0 leaves trust as it is.
    """

    mean: float = 0.5
    weight: float = 0.0

    @classmethod
    def fitted(cls, log: Log, trust: Floats) -> "Shrinkage":
        """Return the shrinkage that fits a log, by the method of moments of the analysis of
        variance.

        The weight is the variance of the ratings of an agent over that of agents; 0 if ratings do
        not show that agents differ, or no agent has two.

        Args:
            log: Log.
            trust: Trust in its ratees with ratings, shape (n,), at least one.
        """
        counts, n = np.bincount(log.ratees), len(log.values)
        size = int(np.count_nonzero(counts))
        means = ratio(np.bincount(log.ratees, log.values), counts)
        within = float(((log.values - means[log.ratees]) ** 2).sum()) / max(n - size, 1)
        there = counts > 0
        between = float((counts * (means - log.values.mean()) ** 2)[there].sum()) / max(size - 1, 1)
        each = (n - float((counts**2).sum()) / n) / max(size - 1, 1)
        variance = (between - within) / each if each else 0.0
        weight = within / variance if variance > 0 and n > size else 0.0
        return cls(float(trust.mean()), weight)

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
