"""The ratings of one round, on a grid of all pairs or as a list of edges: one set of operations for
both.

A trust model is written once, with these operations. On a grid, values of ratings have shape (S, P,
...), and every axis after the second is batch. On edges they have shape (E,), for E pairs that have
a rating: time and memory grow with the number of ratings, not with S times P.
"""

from copy import copy
from typing import Annotated, Any, Final, Literal, TypeAlias

import numpy as np

from roletrust_env.arrays import Array, device_of, largest, namespace, ones, total
from roletrust_env.shapes import (
    PairAge,
    PairFlags,
    PerPair,
    PerProvider,
    PerRater,
    ProviderFlags,
    RaterFlags,
    Shape,
)
from roletrust_env.trust.key_index import Floats, Ints

EdgeInts: TypeAlias = Annotated[Ints, Shape("E", "whole")]
"""Whole numbers, one for each rating on edges, shape (E,)."""

EdgeFloats: TypeAlias = Annotated[Floats, Shape("E")]
"""Numbers, one for each rating on edges, shape (E,)."""

Side: TypeAlias = Literal[0, 1]
"""Role of an agent in a rating, `RATER` or `PROVIDER`: on a grid, the axis of the agents of this
role."""

RATER: Final = 0
"""Side of the raters; on a grid their axis."""

PROVIDER: Final = 1
"""Side of the providers; on a grid their axis."""

TINY = 1e-30
"""Number that replaces a branch at 0; elsewhere it is lost in rounding."""

_SPARE = 4  # numbers for each rating up to which repeats are counted, not sorted

_NO_SIGN = np.uint16(0x7FFF)  # -0.0 is 0.0

_LARGE, _BLOCK = 1_000_000, 100_000
"""Number of ratings above which NumPy works in blocks, and the size of a block: about 30 raters of
3,000 providers."""


class Published:
    """Read-outs of a model whose state has the published trust: `tor`, shape (S, ...), and `top`,
    shape (P, ...).
    """

    def rater_trust(self, state: Any) -> PerRater:
        """Return the trust of each rater. See `TrustModel.rater_trust`."""
        return state.tor

    def provider_trust(self, state: Any) -> PerProvider:
        """Return the trust of each provider. See `TrustModel.provider_trust`."""
        return state.top


class Ratings:
    """The ratings of one round, and the operations that a trust model needs on one value for each
    rating.

    Attributes:
        values: Ratings in [0, 1], and 0 outside the mask: shape (S, P, ...) on a grid, (E,) on
            edges; None for pairs without ratings, see `pairs`.
        mask: Mask on a grid, boolean, shape (S, P, ...); None if every pair has a rating.
        shape: Number of raters S and number of providers P.
        raters: Place of the rater of each rating, whole, shape (E,), in [0, S); None on a grid.
        providers: Place of the provider of each rating, whole, shape (E,), in [0, P); None on a
            grid.
        twins: Place of the rater that is the same agent as the provider, shape (P,), -1 where there
            is none; None on a grid, and if no agent has two roles.
        slots: Place of each rating's pair among the known pairs, shape (E,); None if these are the
            pairs of the round.
        full: Whether this is a grid in which every rater rated every provider.

    Example:
        >>> f, m = np.array([[0.9, 0.4], [0.5, np.nan]]), np.array([[True, True], [True, False]])
        >>> grid = Ratings(f, m)
        >>> edges = Ratings(f[m], raters=np.r_[0, 0, 1], providers=np.r_[0, 1, 0], shape=(2, 2))
        >>> mean(grid, grid.values, PROVIDER), mean(edges, edges.values, PROVIDER)
        (array([0.7, 0.4]), array([0.7, 0.4]))
    """

    _experience: "Ratings | None" = None  # on a grid alone
    providers: Annotated[Array, Shape("E", "whole")] | None = None
    twins: Annotated[Array, Shape("P", "whole")] | None = None
    slots: Annotated[Array, Shape("E", "whole")] | None = None
    _pairs: "Ratings | None" = None  # these four are of edges alone

    def __init__(
        self,
        values: Array,
        mask: PairFlags | None = None,
        *,
        raters: Annotated[Array, Shape("E", "whole")] | None = None,
        providers: Annotated[Array, Shape("E", "whole")] | None = None,
        shape: tuple[int, int] | None = None,
        twins: Annotated[Array, Shape("P", "whole")] | None = None,
        pairs: "Ratings | None" = None,
        slots: Annotated[Array, Shape("E", "whole")] | None = None,
        experience: "Ratings | None" = None,
    ) -> None:
        """Take ratings on a grid; with raters, providers and a shape, take edges, at most one for
        each pair.

        Args:
            values: Ratings, in [0, 1] where the mask is true, anything elsewhere. They must not be
                written to later.
            mask: See `Ratings`.
            raters: See `Ratings`.
            providers: See `Ratings`.
            shape: See `Ratings`.
            twins: See `Ratings`.
            pairs: Known pairs on edges, which have a memory; None if these are the pairs of the
                round.
            slots: See `Ratings`; needed with `pairs`.
            experience: See `Ratings`; only on a grid.

        Raises:
            ValueError: The mask has another shape than the ratings.
        """
        self.values, self.mask, self.raters, self._weights = values, mask, raters, None
        self.shape: tuple[int, int] = values.shape[:2] if shape is None else shape
        self.full = raters is None and mask is None
        self._counts: list[Array | None] = (
            [self.shape[1], self.shape[0]] if self.full else [None, None]
        )
        if raters is not None:
            self.providers, self.twins, self.slots, self._pairs = providers, twins, slots, pairs
        else:
            self._experience = experience
        if raters is None and mask is not None:
            if mask.shape != values.shape:
                raise ValueError(
                    f"mask has shape {tuple(mask.shape)}; it must be that of the ratings, "
                    f"{tuple(values.shape)}"
                )
            xp = namespace(values)
            self._weights = xp.astype(mask, values.dtype)
            self.values = xp.where(mask, values, self._weights)

    @property
    def weights(self) -> Array:
        """Weight of each pair, in the dtype and shape of the ratings: 1 with a rating, 0 without.
        Read only.
        """
        return ones(self.values) if self._weights is None else self._weights

    @property
    def experience(self) -> "Ratings":
        """Services that the raters themselves received, as they perceived them, on a grid.

        A rater remembers them, whether its rating was sent, lost, late or withheld. These are the
        ratings themselves if nothing else is known, as in a log.
        """
        return self if self._experience is None else self._experience

    @property
    def pairs(self) -> "Ratings":
        """All pairs that have a memory. On a grid these are the pairs of the round, on edges the
        pairs known so far.
        """
        return self if self._pairs is None else self._pairs

    def _places(self, side: Side) -> Any:
        """Return the place of the rater or of the provider of each rating; None on a grid."""
        return self.raters if side == RATER else self.providers

    def gather(self, agents: Array, side: Side) -> Array:
        """Return the agent's value for each rating, in a shape that broadcasts with the ratings.

        Multiplied by `weights`, it has the shape of the ratings, which `reduce` needs.

        Args:
            agents: A value for each agent of a side, shape (S, ...) or (P, ...).
            side: Role of these agents.
        """
        if self.raters is None:
            return agents[:, None, ...] if side == RATER else agents
        places = self._places(side)
        return agents.take(places) if isinstance(agents, np.ndarray) else agents[places]

    def reduce(
        self, values: Array, side: Side, op: Literal["sum", "max"] = "sum"
    ) -> PerRater | PerProvider:
        """Return the sum, or the largest, of the values of each agent's ratings, shape (S, ...) or
        (P, ...).

        Args:
            values: A value for each rating, in the shape of the ratings, 0 where there is none. For
                `"max"`, no value may be below 0.
            side: Role of the agents of the result: for `PROVIDER`, the values of a provider's
                raters are added up.
            op: `"sum"`, or `"max"`: the largest of 0 and the values.
        """
        if self.raters is None:
            return total(values, 1 - side) if op == "sum" else largest(values, 1 - side)
        at = sum_at if op == "sum" else largest_at
        return at(self._places(side), values, self.shape[side])

    def count(self, side: Side) -> Array:
        """Return the number of ratings of each agent, shape (S, ...) or (P, ...); one number if
        this is full.
        """
        known = self._counts[side]
        if known is None:
            if isinstance(self.raters, np.ndarray):
                known = np.bincount(self._places(side), minlength=self.shape[side]).astype(
                    self.values.dtype
                )
            else:
                known = self.reduce(self.weights, side)
            self._counts[side] = known
        return known

    def rated(self, side: Side) -> RaterFlags | ProviderFlags:
        """Return whether each agent has a rating, boolean, shape (S, ...) or (P, ...)."""
        return (self.reduce(self.weights, side) if self.full else self.count(side)) > 0

    def weigh(self, values: Array) -> Array:
        """Return the values with a rating, and 0 for those without."""
        return values if self._weights is None else self._weights * values

    def read(self, memory: PerPair) -> Array:
        """Return the memory of the pair of each rating."""
        return memory if self.slots is None else memory[self.slots]

    def write(self, memory: PerPair, values: Array | float) -> PerPair:
        """Return a memory with new values where the pair has a rating in this round, and as it was
        elsewhere.

        Args:
            memory: Memory before the round, which is not changed.
            values: A value for each rating, or one number.
        """
        xp = namespace(memory)
        if self.raters is None:
            if self.mask is not None:
                return xp.where(self.mask, values, memory)
            return xp.zeros_like(memory) + values if isinstance(values, float) else values
        after = xp.empty_like(memory) if self.slots is None else memory + 0
        after[slice(None) if self.slots is None else self.slots] = values
        return after

    def sorted_by_provider(self) -> tuple["Ratings", Array, Array]:
        """Return each provider's ratings in ascending order: pairs, values, and places among the
        provider's ratings.

        On a grid, pairs without a rating come last, with the value infinity.
        """
        xp, values = namespace(self.values), self.values
        if self.raters is None or self.providers is None:
            if self.mask is not None:
                values = xp.where(self.mask, values, float("inf"))
            place = xp.arange(len(values), dtype=values.dtype, device=device_of(values))
            return self, xp.sort(values, axis=0), place.reshape(-1, *[1] * (values.ndim - 1))
        order = _stable_order(values)
        order = order[_stable_order(self.providers[order])]
        raters, providers, received = (
            self.raters[order],
            self.providers[order],
            self.count(PROVIDER),
        )
        first = xp.cumulative_sum(received) - received
        place = xp.arange(len(order), dtype=values.dtype, device=values.device) - first[providers]
        return (
            Ratings(None, raters=raters, providers=providers, shape=self.shape),
            values[order],
            place,
        )

    def blocks(self) -> list[slice]:
        """Return slices of raters whose ratings fit into a processor's cache; one slice if the
        library does that.
        """
        values = self.values
        if self.raters is not None or not isinstance(values, np.ndarray) or values.size <= _LARGE:
            return [slice(None)]
        rows = max(1, _BLOCK * len(values) // values.size)
        return [slice(at, at + rows) for at in range(0, len(values), rows)]

    def rows(self, block: slice) -> "Ratings":
        """Return the ratings of some raters on a grid; the providers' counts are still those of all
        raters.
        """
        part, given = copy(self), self.count(RATER)
        part._counts = [given if self.full else given[block], self.count(PROVIDER)]
        part.values, part.shape = self.values[block], (len(self.values[block]), self.shape[1])
        if self.mask is not None and self._weights is not None:
            part.mask, part._weights = self.mask[block], self._weights[block]
        return part


def mean(ratings: Ratings, values: Array, side: Side) -> PerRater | PerProvider:
    """Return the mean of the values of each agent's ratings, shape (S, ...) or (P, ...), and 0
    where there are none.

    Args:
        ratings: Ratings of the round.
        values: A value for each rating, finite; values without a rating do not count.
        side: Role of the agents.
    """
    if ratings.full:
        return values.mean(axis=1 - side)
    if ratings.mask is not None:
        values = namespace(values).where(ratings.mask, values, 0.0)
        return values.sum(axis=1 - side) / (ratings.count(side) + TINY)
    return ratings.reduce(values, side) / (ratings.count(side) + TINY)


def weighted_mean(
    pairs: Ratings, values: Array, weights: Array, side: Side
) -> PerRater | PerProvider:
    """Return the weighted mean of each agent's values, shape (S, ...) or (P, ...), and 0 where all
    weights are 0.

    Args:
        pairs: Ratings of the round, or pairs that have a memory.
        values: A value for each of them, finite also where the weight is 0.
        weights: Weights of at least 0, in a shape that broadcasts with the values.
        side: Role of the agents.
    """
    return pairs.reduce(weights * values, side) / (pairs.reduce(weights, side) + TINY)


def smooth(value: Array, previous: Array, lam: float, count: Array) -> Array:
    """Return the exponential mean lam * value + (1 - lam) * previous, and the previous value where
    the count is 0.

    It is computed as a step from the previous value, so that it is exact where the step is 0.

    Args:
        value: Mean of a round, as from `mean`.
        previous: Exponential mean before the round.
        lam: Weight of the newest round.
        count: Number of values in the mean, see `Ratings.count`; 0 where there are none.

    Raises:
        TypeError: The count has another dtype, such as that of whole numbers, which would change
            that of the trust.
    """
    kind = getattr(count, "dtype", previous.dtype)  # the count of full ratings is one number
    if kind != previous.dtype:
        raise TypeError(
            f"smooth has a count of dtype {kind}; it must be {previous.dtype}, as the mean so far, "
            "see ratings.count"
        )
    return previous + lam * occurred(count) * (value - previous)


def occurred(count: Array) -> Array:
    """Return 1 where a count is above 0 and 0 where it is 0, in the dtype of the count."""
    return count / (count + TINY)


def aged(ratings: Ratings, ages: PairAge) -> PairAge:
    """Return the ages after the round: 1 for a pair with a rating in it, 1 more for others that
    ever had one.
    """
    only_these = ratings.raters is not None and ratings.slots is None
    return ratings.write(ages if only_these else ages + ages / (ages + TINY), 1.0)


def merge_repeats(
    raters: EdgeInts,
    providers: EdgeInts,
    values: EdgeFloats,
    pair: EdgeInts,
) -> tuple[Ints, Ints, Floats, Ints]:
    """Return the ratings of a round as edges with one rating for each pair: the mean of its
    ratings.

    A rater has one voice about a provider in a round. Otherwise it could outvote others by
    repeating itself, and the ratings of a round, which have no order, would need one.

    Args:
        raters: Place of the rater of each rating, shape (E,).
        providers: Place of the provider of each rating, shape (E,).
        values: Ratings, shape (E,).
        pair: Number that tells pairs apart, whole, at least 0, shape (E,).

    Returns:
        The raters, the providers, the values and the pairs; the arguments themselves if no pair
        repeats.

    Example:
        >>> _, _, values, pair = merge_repeats(np.r_[0, 0, 1], np.r_[1, 1, 0], np.r_[0.2, 0.6, 1.0], np.r_[1, 1, 2])
        >>> values, pair
        (array([0.4, 1. ]), array([1, 2]))
    """  # noqa: E501
    numbers = pair
    if (pair[1:] > pair[:-1]).all():  # as where all pairs are new
        return raters, providers, values, pair
    if pair.max(initial=0) > _SPARE * len(pair):  # they are too far apart to be counted
        ordered = np.sort(pair)
        if (ordered[1:] != ordered[:-1]).all():
            return raters, providers, values, pair
        numbers = np.unique(pair, return_inverse=True)[1]
    counts = np.bincount(numbers)
    if counts.max(initial=0) <= 1:
        return raters, providers, values, pair
    present = counts.nonzero()[0]
    last = np.empty_like(counts)
    last[numbers] = np.arange(len(numbers))
    last = last[present]
    return (
        raters[last],
        providers[last],
        np.bincount(numbers, values)[present] / counts[present],
        pair[last],
    )


def _stable_order(numbers: Array) -> Array:
    """Return the order of numbers of at least 0, as a stable `argsort` does.

    NumPy sorts whole numbers of 16 bits in linear time, so many numbers are sorted by one digit
    after the other.
    """
    if not isinstance(numbers, np.ndarray) or numbers.itemsize < 8 or len(numbers) < _BLOCK:
        return namespace(numbers).argsort(numbers, stable=True)
    low, middle, high, top = (
        np.ascontiguousarray(numbers).view(np.uint16).reshape(-1, 4).T
    )  # of the processors of today
    order = np.arange(len(numbers))
    for digit in (low, middle, high, top & _NO_SIGN):
        if digit.any():
            order = order[np.argsort(digit[order], stable=True)]
    return order


def sum_at(places: Array, values: Array, length: int) -> Array:
    """Return the sum of the values at each place, shape (length,), in the dtype of the values."""
    if isinstance(values, np.ndarray):
        return np.bincount(places, weights=values, minlength=length).astype(
            values.dtype, copy=False
        )
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
