"""The ratings of one round, on a grid of all pairs or as a list of edges: one set of operations for both.

A trust model is written once, with these operations. On a grid, a cell is an entry of an array of shape (S, P, ...).
On edges, a cell is an entry of an array of shape (E,), and only the pairs that exist have one.
"""

from abc import ABC, abstractmethod
from typing import Annotated, Any, TypeAlias

import numpy as np

from roletrust_env.arrays import Array, largest, namespace, total

PerRater: TypeAlias = Annotated[Any, "rater"]
"""Array with an entry for each rater, shape (S, ...)."""

PerProvider: TypeAlias = Annotated[Any, "provider"]
"""Array with an entry for each provider, shape (P, ...)."""

PerPair: TypeAlias = Annotated[Any, "pair"]
"""Memory of each pair, 0 where there is none: shape (S, P, ...) on a grid, (K,) for K known pairs on edges."""

PairAge: TypeAlias = Annotated[Any, "age"]
"""Number of rounds since the last rating of each pair, 0 where there is none; otherwise as `PerPair`."""

_LARGE, _BLOCK = 1_000_000, 100_000
"""Number of ratings above which NumPy works in blocks, and the size of a block: about 30 raters of 3,000 providers."""

TINY = 1e-30
"""Number that replaces a branch at 0; elsewhere it is lost in rounding."""


class Cells(ABC):
    """Pairs of raters and providers, and the operations that a trust model needs on one value for each pair.

    Attributes:
        shape: Number of raters S and number of providers P.
    """

    shape: tuple[int, int]

    @abstractmethod
    def of_raters(self, values: Array) -> Array:
        """Return the rater's value for each cell, from shape (S, ...), in a shape that broadcasts with the cells."""

    @abstractmethod
    def of_providers(self, values: Array) -> Array:
        """Return the provider's value for each cell, from shape (P, ...), in a shape that broadcasts with the cells."""

    @abstractmethod
    def sum_over_raters(self, cells: Array) -> Array:
        """Return the sum over the raters of each provider, shape (P, ...)."""

    @abstractmethod
    def sum_over_providers(self, cells: Array) -> Array:
        """Return the sum over the providers of each rater, shape (S, ...)."""

    @abstractmethod
    def largest_over_raters(self, cells: Array) -> Array:
        """Return the largest of 0 and each provider's cells, shape (P, ...). No cell is below 0."""

    def weighted_mean_over_raters(self, cells: Array, weights: Array) -> Array:
        """Return the weighted mean over the raters of each provider, shape (P, ...), and 0 where all weights are 0.

        Args:
            cells: Values, finite also where the weight is 0.
            weights: Weights of at least 0, in a shape that broadcasts with the cells.
        """
        return self.sum_over_raters(weights * cells) / (self.sum_over_raters(weights) + TINY)

    def weighted_mean_over_providers(self, cells: Array, weights: Array) -> Array:
        """Return the weighted mean over the providers of each rater, shape (S, ...), and 0 where all weights are 0."""
        return self.sum_over_providers(weights * cells) / (self.sum_over_providers(weights) + TINY)

    # --- agents of two roles, for models that take peers ----------------------------------------------

    @abstractmethod
    def agents(self, peers: PerPair) -> Array:
        """Return the number of agents N: an agent of two roles counts once.

        Args:
            peers: Flag, 1 where a rater and a provider are one agent. On edges the cells themselves know that.
        """

    @abstractmethod
    def apart(self, peers: PerPair) -> Array:
        """Return 1 for each cell whose rater and provider are two agents, and 0 for an agent's cell with itself."""

    @abstractmethod
    def of_own_role(self, values: Array, peers: PerPair) -> Array:
        """Return the provider's value of each rater that provides, from shape (P, ...), and 0 of others, (S, ...)."""


class Ratings(Cells):
    """The ratings of one round, prepared once for all the means that a model takes of them.

    Attributes:
        values: Ratings, one for each cell, in [0, 1]; on a grid 0 where there is none.
        received: Number of ratings of each provider, shape (P, ...); one number where it is S for all.
        given: Number of ratings by each rater, shape (S, ...); one number where it is P for all.
        full: Whether the cells are a grid in which every rater rated every provider.
    """

    values: Array
    received: Array
    given: Array
    full: bool = False

    @property
    @abstractmethod
    def pairs(self) -> Cells:
        """All pairs that have a memory. On a grid these are the cells of the round, on edges the pairs known so far."""

    @abstractmethod
    def recall(self, memory: PerPair) -> Array:
        """Return the memory of the pair of each cell of the round."""

    @abstractmethod
    def remember(self, memory: PerPair, cells: Array | float) -> PerPair:
        """Return a memory with the new values where the pair has a rating in this round, and as it was elsewhere."""

    def pass_time(self, ages: PairAge) -> PairAge:
        """Return the ages after the round: 1 for a pair with a rating in it, 1 more for others that ever had one."""
        return self.remember(ages + ages / (ages + TINY), 1.0)

    @abstractmethod
    def weigh(self, cells: Array) -> Array:
        """Return the cells with a rating, and 0 for those without."""

    @abstractmethod
    def mean_over_raters(self, cells: Array) -> Array:
        """Return the mean over the ratings of each provider, shape (P, ...), and 0 where there are none."""

    @abstractmethod
    def mean_over_providers(self, cells: Array) -> Array:
        """Return the mean over the ratings by each rater, shape (S, ...), and 0 where there are none."""

    @abstractmethod
    def in_order(self) -> tuple[Cells, Array, Array]:
        """Return each provider's ratings in ascending order: cells, values, and places among the provider's ratings.

        On a grid, cells without a rating come last.
        """

    def blocks(self) -> list[slice]:
        """Return slices of raters whose ratings fit into a processor's cache; one slice if the library does that."""
        return [slice(None)]

    def rows(self, some: slice) -> "Ratings":
        """Return the ratings of some raters; `received` still counts all."""
        return self


class MaskedRatings(Ratings):
    """The ratings of one round on a grid: an array of shape (S, P, ...), and a mask.

    Attributes:
        values: Ratings inside the mask and 0 elsewhere, shape (S, P, ...).
        mask: Mask, boolean, shape (S, P, ...); None if every rater rated every provider.
        weights: Weights, 1 inside the mask and 0 elsewhere, shape (S, P, ...), in the dtype of the ratings; None if
            every rater rated every provider.
    """

    def __init__(self, values: Array, mask: Array | None, weights: Array | None, received: Array, given: Array) -> None:
        self.values, self.mask, self.weights = values, mask, weights
        self.received, self.given, self.full = received, given, mask is None
        self.shape = values.shape[:2]

    @classmethod
    def of(cls, ratings: Array, mask: Array | None) -> "MaskedRatings":
        """Return the ratings inside a mask, both of shape (S, P, ...); None is a mask that is true everywhere."""
        if mask is None:
            return cls(ratings, None, None, *ratings.shape[:2])
        xp = namespace(ratings)
        weights = xp.astype(mask, ratings.dtype)
        values = xp.where(mask, ratings, weights)
        return cls(values, mask, weights, total(weights, 0), total(weights, 1))

    @property
    def pairs(self) -> "MaskedRatings":
        """The cells of the round."""
        return self

    def of_raters(self, values: Array) -> Array:
        """Return the values with an axis for the providers. See `Cells.of_raters`."""
        return values[:, None, ...]

    def of_providers(self, values: Array) -> Array:
        """Return the values. See `Cells.of_providers`."""
        return values

    def sum_over_raters(self, cells: Array) -> Array:
        """Return the sum along the first axis. See `Cells.sum_over_raters`."""
        return total(cells, 0)

    def sum_over_providers(self, cells: Array) -> Array:
        """Return the sum along the second axis. See `Cells.sum_over_providers`."""
        return total(cells, 1)

    def largest_over_raters(self, cells: Array) -> Array:
        """Return the maximum along the first axis. See `Cells.largest_over_raters`."""
        return largest(cells)

    def recall(self, memory: Array) -> Array:
        """Return the memory. See `Ratings.recall`."""
        return memory

    def remember(self, memory: Array, cells: Array | float) -> Array:
        """Return the new values inside the mask. See `Ratings.remember`."""
        xp = namespace(memory)
        if self.mask is None:
            return xp.zeros_like(memory) + cells if isinstance(cells, float) else cells
        return xp.where(self.mask, cells, memory)

    def weigh(self, cells: Array) -> Array:
        """Return the cells inside the mask, and 0 elsewhere."""
        return cells if self.weights is None else self.weights * cells

    def mean_over_raters(self, cells: Array) -> Array:
        """Return the mean along the first axis. See `Ratings.mean_over_raters`."""
        return masked_mean(cells, self.mask, axis=0)[0]

    def mean_over_providers(self, cells: Array) -> Array:
        """Return the mean along the second axis. See `Ratings.mean_over_providers`."""
        return masked_mean(cells, self.mask, axis=1)[0]

    def in_order(self) -> tuple[Cells, Array, Array]:
        """Return the ratings sorted along the first axis. See `Ratings.in_order`."""
        xp, values = namespace(self.values), self.values
        if self.weights is not None:
            values = xp.where(self.weights > 0, values, float("inf"))  # absent ratings come last
        place = xp.arange(len(values), dtype=values.dtype, device=values.device)
        return self, xp.sort(values, axis=0), place.reshape(-1, *[1] * (values.ndim - 1))

    def agents(self, peers: Array) -> Array:
        """Return the number of agents, shape (...). See `Cells.agents`."""
        return sum(peers.shape[:2]) - total(total(peers, 0), 0)

    def apart(self, peers: Array) -> Array:
        """Return the complement of the peers. See `Cells.apart`."""
        return 1 - peers

    def of_own_role(self, values: Array, peers: Array) -> Array:
        """Return the values of the raters that provide. See `Cells.of_own_role`."""
        return total(peers * values, 1)

    def blocks(self) -> list[slice]:
        """Return slices of raters whose ratings fit into a processor's cache; one slice if the library does that."""
        raters, values = len(self.values), self.values
        if not isinstance(values, np.ndarray) or values.size <= _LARGE:
            return [slice(raters)]
        rows = max(1, _BLOCK * raters // values.size)
        return [slice(at, at + rows) for at in range(0, raters, rows)]

    def rows(self, some: slice) -> "MaskedRatings":
        """Return the ratings of some raters; `received` still counts all."""
        if self.mask is None or self.weights is None:
            return MaskedRatings(self.values[some], None, None, self.received, self.given)
        return MaskedRatings(self.values[some], self.mask[some], self.weights[some], self.received, self.given[some])


def masked_mean(values: Array, mask: Array | None, *, axis: int) -> tuple[Array, Array]:
    """Return the mean of the values inside the mask along an axis, 0 where there are none, and their number.

    A mask of None is true everywhere.
    """
    if mask is None:
        return values.mean(axis=axis), values.shape[axis]
    count = mask.sum(axis=axis, dtype=values.dtype)
    return namespace(values).where(mask, values, 0.0).sum(axis=axis) / (count + TINY), count
