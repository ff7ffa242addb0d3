"""Ratings as a list of edges, for logs in which few of the raters rate few of the providers.

One round of one game: each rating is an edge from a rater to a provider. All sums run over edges, so time and memory
grow with the number of ratings, not with S times P.
"""

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.trust.ratings import TINY, Cells, PairAge, PerPair, Ratings


class EdgeCells(Cells):
    """Pairs of raters and providers as two arrays of places, shape (K,).

    Attributes:
        raters: Place of the rater of each pair, whole, in [0, S).
        providers: Place of the provider of each pair, whole, in [0, P).
        shape: Number of raters S and number of providers P.
        twins: Place of the rater that is the same agent as the provider, shape (P,), -1 where there is none; None if no
            agent has two roles.
    """

    def __init__(self, raters: Array, providers: Array, shape: tuple[int, int], *, twins: Array | None = None) -> None:
        self.raters, self.providers, self.shape, self.twins = raters, providers, shape, twins

    def of_raters(self, values: Array) -> Array:
        """Return the rater's value for each edge. See `Cells.of_raters`."""
        return values[self.raters]

    def of_providers(self, values: Array) -> Array:
        """Return the provider's value for each edge. See `Cells.of_providers`."""
        return values[self.providers]

    def sum_over_raters(self, cells: Array) -> Array:
        """Return the sum by provider. See `Cells.sum_over_raters`."""
        return sum_at(self.providers, cells, self.shape[1])

    def sum_over_providers(self, cells: Array) -> Array:
        """Return the sum by rater. See `Cells.sum_over_providers`."""
        return sum_at(self.raters, cells, self.shape[0])

    def largest_over_raters(self, cells: Array) -> Array:
        """Return the maximum by provider, at least 0. See `Cells.largest_over_raters`."""
        return largest_at(self.providers, cells, self.shape[1])

    def agents(self, peers: PerPair) -> Array:
        """Return the number of agents. See `Cells.agents`."""
        return sum(self.shape) - (0 if self.twins is None else int((self.twins >= 0).sum()))

    def apart(self, peers: PerPair) -> Array:
        """Return 0 for an agent's cell with itself, and 1 elsewhere. See `Cells.apart`."""
        two = self.raters >= 0 if self.twins is None else self.twins[self.providers] != self.raters
        return namespace(peers).astype(two, peers.dtype)

    def of_own_role(self, values: Array, peers: PerPair) -> Array:
        """Return the provider's value of each rater that provides, and 0 of others. See `Cells.of_own_role`."""
        xp = namespace(values)
        own = xp.zeros(self.shape[0], dtype=values.dtype, device=values.device)
        if self.twins is not None:
            own[self.twins[self.twins >= 0]] = values[self.twins >= 0]
        return own


class EdgeRatings(EdgeCells, Ratings):
    """The ratings of one round as edges, at most one for each pair; see `edge_ratings`.

    Attributes:
        values: Rating of each edge, shape (E,), in [0, 1].
        pairs: Known pairs, which have a memory.
        slots: Place of each edge among the known pairs, shape (E,); None if the known pairs are the edges.
    """

    def __init__(self, cells: EdgeCells, values: Array, pairs: EdgeCells, slots: Array | None) -> None:
        super().__init__(cells.raters, cells.providers, cells.shape, twins=cells.twins)
        xp = namespace(values)
        self.values, self.slots, self._pairs = values, slots, pairs
        one = xp.ones_like(values)
        self.received, self.given = self.sum_over_raters(one), self.sum_over_providers(one)

    @property
    def pairs(self) -> EdgeCells:
        """The known pairs."""
        return self._pairs

    def recall(self, memory: PerPair) -> Array:
        """Return the memory of the pair of each edge. See `Ratings.recall`."""
        return memory if self.slots is None else memory[self.slots]

    def remember(self, memory: PerPair, cells: Array | float) -> PerPair:
        """Return a memory with the new values of the pairs of this round. See `Ratings.remember`."""
        after = namespace(memory).empty_like(memory) if self.slots is None else memory + 0
        after[slice(None) if self.slots is None else self.slots] = cells
        return after

    def pass_time(self, ages: PairAge) -> PairAge:
        """Return the ages after the round. See `Ratings.pass_time`."""
        return self.remember(ages, 1.0) if self.slots is None else super().pass_time(ages)

    def weigh(self, cells: Array) -> Array:
        """Return the cells: every edge has a rating."""
        return cells

    def mean_over_raters(self, cells: Array) -> Array:
        """Return the mean by provider. See `Ratings.mean_over_raters`."""
        return self.sum_over_raters(cells) / (self.received + TINY)

    def mean_over_providers(self, cells: Array) -> Array:
        """Return the mean by rater. See `Ratings.mean_over_providers`."""
        return self.sum_over_providers(cells) / (self.given + TINY)

    def in_order(self) -> tuple[Cells, Array, Array]:
        """Return the ratings sorted by provider and value. See `Ratings.in_order`."""
        xp = namespace(self.values)
        order = xp.argsort(self.values, stable=True)
        order = order[xp.argsort(self.providers[order], stable=True)]
        raters, providers = self.raters[order], self.providers[order]
        first = xp.cumulative_sum(self.received) - self.received
        place = xp.arange(len(order), dtype=self.values.dtype, device=self.values.device) - first[providers]
        return EdgeCells(raters, providers, self.shape), self.values[order], place


def edge_ratings(
    raters: Array,
    providers: Array,
    values: Array,
    shape: tuple[int, int],
    *,
    twins: Array | None = None,
    known: EdgeCells | None = None,
    slots: Array | None = None,
) -> EdgeRatings:
    """Return the ratings of one round as edges. Several ratings of a pair count as one, see `merge_repeats`.

    Args:
        raters: Place of the rater of each rating, whole, shape (E,), in [0, S).
        providers: Place of the provider of each rating, whole, shape (E,), in [0, P).
        values: Ratings, shape (E,), in [0, 1].
        shape: Number of raters S and number of providers P.
        twins: Place of the rater that is the same agent as each provider, see `EdgeCells`.
        known: Pairs that have a memory; None if these are the pairs of the round.
        slots: Place of each rating's pair among the known pairs, shape (E,); needed with `known`.
    """
    pair = providers + shape[1] * raters if slots is None else slots
    raters, providers, values, pair = merge_repeats(raters, providers, values, pair)
    cells = EdgeCells(raters, providers, shape, twins=twins)
    return EdgeRatings(cells, values, cells, None) if known is None else EdgeRatings(cells, values, known, pair)


def merge_repeats(raters: Array, providers: Array, values: Array, pair: Array) -> tuple[Array, Array, Array, Array]:
    """Return the ratings of a round with one rating for each pair: the mean of its ratings.

    A rater has one voice about a provider in a round. Otherwise it could outvote others by repeating itself, and the
    ratings of a round, which have no order, would need one.

    Args:
        raters: Place of the rater of each rating, shape (E,).
        providers: Place of the provider of each rating, shape (E,).
        values: Ratings, shape (E,).
        pair: Number that tells pairs apart, whole, shape (E,).

    Returns:
        The raters, the providers, the values and the pairs; the arguments themselves if no pair repeats.

    Example:
        >>> import numpy as np
        >>> _, _, values, pair = merge_repeats(np.r_[0, 0, 1], np.r_[1, 1, 0], np.r_[0.2, 0.6, 1.0], np.r_[1, 1, 2])
        >>> values, pair
        (array([0.4, 1. ]), array([1, 2]))
    """
    xp = namespace(values)
    ordered = xp.sort(pair)
    if not bool((ordered[1:] == ordered[:-1]).any()):
        return raters, providers, values, pair
    distinct, which = xp.unique_inverse(pair)
    one = xp.zeros_like(distinct)
    one[which] = xp.arange(len(pair), dtype=distinct.dtype, device=distinct.device)
    mean = sum_at(which, values, len(distinct)) / sum_at(which, xp.ones_like(values), len(distinct))
    return raters[one], providers[one], mean, distinct


def sum_at(places: Array, values: Array, length: int) -> Array:
    """Return the sum of the values at each place, shape (length,), in the dtype of the values."""
    if isinstance(values, np.ndarray):
        return np.bincount(places, weights=values, minlength=length).astype(values.dtype, copy=False)
    xp = namespace(values)
    return xp.zeros(length, dtype=values.dtype, device=values.device).index_add(0, places, values)


def largest_at(places: Array, values: Array, length: int) -> Array:
    """Return the largest of 0 and the values at each place, shape (length,)."""
    xp = namespace(values)
    most = xp.zeros(length, dtype=values.dtype, device=values.device)
    if isinstance(values, np.ndarray):
        np.maximum.at(most, places, values)
        return most
    return most.scatter_reduce(0, places, values, "amax")
