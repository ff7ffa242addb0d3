"""The three algorithms of Su and Saint-Jore (EWSN 2023, hal-04161463) as pure functions over arrays.

Axis 0 is the service rater i (of S), axis 1 the service provider j (of P); every further axis is batch. The functions
run on NumPy and on torch alike, change none of their inputs, and follow the dtype of the ratings.
"""

import math
import operator
from collections.abc import Callable
from functools import reduce
from typing import NamedTuple

import numpy as np

from roletrust_env.arrays import Array, is_compiling, largest, namespace, total

_SINC = (-0.64493406, 0.16680776, -0.023938661, 0.0021907927, -0.00012584944)
"""Coefficients of `_sinc_polynomial`, the constant first."""

_LARGE, _BLOCK = 1_000_000, 100_000
"""Number of ratings above which NumPy works in blocks, and the size of a block: about 30 raters of 3,000 providers."""

_TINY = 1e-30  # replaces a branch at 0; elsewhere it is lost in rounding


def rater_trust(ratings: Array, mask: Array, *, previous: Array, lam: float) -> Array:
    """Return the trust of each rater, ToR (Algorithm 1): how near its ratings are to the average ratings.

        fbar[j] = mean over the raters i of j of f[i, j]
        QoR[i]  = 1 - mean over the providers j that i rated of sqrt(|f[i, j] - fbar[j]|)
        ToR[i] <- lam * QoR[i] + (1 - lam) * ToR[i]

    Args:
        ratings: Ratings f, shape (S, P, ...), each in [0, 1]. Cells outside the mask are ignored, whatever they hold.
        mask: Mask m, shape (S, P, ...), boolean, true where i rated j in this round.
        previous: Trust ToR before the round, shape (S, ...), in [0, 1].
        lam: Weight of the newest round, in [0.5, 1].

    Returns:
        ToR after the round, shape (S, ...), in [0, 1]. A rater without ratings in this round keeps its ToR.

    Raises:
        ValueError: If `lam` is outside [0.5, 1], or the shapes do not match.

    Example:
        >>> import numpy as np
        >>> ratings = np.array([[1.0, 1.0], [1.0, 1.0], [0.5, 0.5]])
        >>> rater_trust(ratings, ratings >= 0, previous=np.ones(3), lam=1.0).round(4)
        array([0.5918, 0.5918, 0.4226])
    """
    if not 0.5 <= lam <= 1:
        raise ValueError(f"lam is {lam!r}; for the trust of a rater it must lie in [0.5, 1]")
    _check_shapes(ratings, mask=(mask, "SP"), previous=(previous, "S"))
    masked = MaskedRatings.of(ratings, mask)
    return smooth(rater_quality(masked), previous, lam, masked.given)


def provider_trust(
    ratings: Array,
    mask: Array,
    *,
    tor: Array,
    previous: Array,
    lam: float,
    last_ratings: Array,
    elapsed: Array,
) -> Array:
    """Return the trust of each provider, ToP (Algorithm 2): its ratings' level, their steadiness, their raters' trust.

        rho[i, j] = sinc(1 - f[i, j]) * sinc(delta[i, j]) ** dt[i, j],   delta = |f - the last rating that i gave j|
        QoP[j]    = mean over the raters i of j of rho[i, j] * ToR[i] * f[i, j]
        ToP[j]   <- lam * QoP[j] + (1 - lam) * ToP[j]

    Args:
        ratings: Ratings f, shape (S, P, ...), each in [0, 1]. Cells outside the mask are ignored, whatever they hold.
        mask: Mask m, shape (S, P, ...), boolean, true where i rated j in this round.
        tor: Trust ToR as just updated by this round, shape (S, ...), in [0, 1].
        previous: Trust ToP before the round, shape (P, ...), in [0, 1].
        lam: Weight of the newest round, in [0.5, 1).
        last_ratings: Last rating that i gave j, shape (S, P, ...); ignored where `elapsed` is 0.
        elapsed: Time dt, in service periods since i last rated j, shape (S, P, ...), and 0 where i never did: a first
            rating has sinc(delta) ** 0 = 1.

    Returns:
        ToP after the round, shape (P, ...), in [0, 1]. A provider without ratings keeps its ToP.

    Raises:
        ValueError: If `lam` is outside [0.5, 1), or the shapes do not match.
    """
    if not 0.5 <= lam < 1:
        raise ValueError(f"lam is {lam!r}; for the trust of a provider it must lie in [0.5, 1)")
    _check_shapes(
        ratings,
        mask=(mask, "SP"),
        tor=(tor, "S"),
        previous=(previous, "P"),
        last_ratings=(last_ratings, "SP"),
        elapsed=(elapsed, "SP"),
    )
    masked = MaskedRatings.of(ratings, mask)
    quality = provider_quality(masked, tor, last_ratings, _like(elapsed, ratings))
    return smooth(quality, previous, lam, masked.received)


def agent_trust(tor: Array, top: Array, *, rated: Array, provided: Array, initial: float) -> Array:
    """Return the trust of each agent, ToA (Algorithm 3): its two trusts, weighted by how often it played each role.

        alpha[k] = rated[k] / (rated[k] + provided[k])
        ToA[k]   = alpha[k] * ToR[k] + (1 - alpha[k]) * ToP[k]

    Args:
        tor: Trust ToR of each agent, shape (N, ...), in [0, 1].
        top: Trust ToP of each agent, shape (N, ...), in [0, 1].
        rated: Number of services that the agent rated so far, shape (N, ...), at least 0.
        provided: Number of services that the agent provided so far, shape (N, ...), at least 0.
        initial: Trust of an agent that did neither, in [0, 1].

    Returns:
        The trust ToA, shape (N, ...), in [0, 1].

    Raises:
        ValueError: If `initial` is outside [0, 1].

    Example:
        >>> import numpy as np
        >>> counts = {"rated": np.array([3.0, 0.0]), "provided": np.array([1.0, 0.0])}
        >>> agent_trust(np.array([0.8, 0.9]), np.array([0.4, 0.9]), initial=0.5, **counts).round(3)
        array([0.7, 0.5])
    """
    if not 0 <= initial <= 1:
        raise ValueError(f"initial is {initial!r}; a trust must lie in [0, 1]")
    rated, provided = _like(rated, tor), _like(provided, tor)
    total = rated + provided
    alpha = rated / (total + _TINY)
    return namespace(tor).where(total > 0, alpha * tor + (1 - alpha) * top, initial)


class Trusts(NamedTuple):
    """The trust of the raters, shape (S, ...), and of the providers, shape (P, ...)."""

    tor: Array
    top: Array


class MaskedRatings(NamedTuple):
    """The ratings of one round, prepared once for all the means that a model takes of them.

    Attributes:
        values: Ratings inside the mask and 0 elsewhere, shape (S, P, ...).
        weights: Weights, 1 inside the mask and 0 elsewhere, shape (S, P, ...), in the dtype of the ratings; None if
            every rater rated every provider.
        received: Number of ratings of each provider, shape (P, ...); one number where it is S for all.
        given: Number of ratings by each rater, shape (S, ...); one number where it is P for all.
    """

    values: Array
    weights: Array | None
    received: Array
    given: Array

    @classmethod
    def of(cls, ratings: Array, mask: Array | None) -> "MaskedRatings":
        """Return the ratings inside a mask, both of shape (S, P, ...); None is a mask that is true everywhere."""
        if mask is None:
            return cls(ratings, None, *ratings.shape[:2])
        xp = namespace(ratings)
        weights = xp.astype(mask, ratings.dtype)
        values = xp.where(mask, ratings, weights)
        return cls(values, weights, total(weights, 0), total(weights, 1))

    def weigh(self, cells: Array) -> Array:
        """Return the cells inside the mask, and 0 elsewhere."""
        return cells if self.weights is None else self.weights * cells

    def blocks(self) -> list[slice]:
        """Return slices of raters whose ratings fit into a processor's cache; one slice if the library does that."""
        raters, values = len(self.values), self.values
        if not isinstance(values, np.ndarray) or values.size <= _LARGE:
            return [slice(raters)]
        rows = max(1, _BLOCK * raters // values.size)
        return [slice(at, at + rows) for at in range(0, raters, rows)]

    def of_raters(self, some: slice) -> "MaskedRatings":
        """Return the ratings of some raters; `received` still counts all."""
        weights = None if self.weights is None else self.weights[some]
        return MaskedRatings(
            self.values[some], weights, self.received, self.given if weights is None else self.given[some]
        )


Root = Callable[[Array], Array]
"""A function in place of the square root."""


def rater_quality(masked: MaskedRatings, root: Root | None = None) -> Array:
    """Return QoR of Algorithm 1, shape (S, ...); 1 for a rater without ratings.

    Args:
        masked: Ratings of the round.
        root: Function in place of the square root, for callers that need a slope at 0.
    """
    xp = namespace(masked.values)
    root = root or xp.sqrt
    # Relative to the best rating, raters who agree are exactly 0 from the average; sqrt would magnify rounding.
    best = largest(masked.values)
    blocks = masked.blocks()
    if len(blocks) == 1:
        below = masked.weigh(masked.values - best)
        return _nearness(masked, below - total(below, 0) * _share(masked.received), root)
    parts = [masked.of_raters(some) for some in blocks]
    below = reduce(operator.add, (total(part.weigh(part.values - best), 0) for part in parts))
    average = below * _share(masked.received)
    return xp.concat([_nearness(part, part.weigh(part.values - best) - average, root) for part in parts])


def _nearness(masked: MaskedRatings, apart: Array, root: Root) -> Array:
    """Return 1 minus the mean root of the distances of each rater's ratings to the average ratings."""
    return 1.0 - total(masked.weigh(root(abs(apart))), 1) * _share(masked.given)


def provider_quality(masked: MaskedRatings, tor: Array, last_ratings: Array, elapsed: Array | None) -> Array:
    """Return QoP of Algorithm 2, shape (P, ...); 0 for a provider without ratings.

    Args:
        masked: Ratings of the round.
        tor: Trust ToR as just updated by this round, shape (S, ...).
        last_ratings: Last rating that i gave j, shape (S, P, ...).
        elapsed: Time dt, see `provider_trust`; None where it is 1 everywhere.
    """
    if len(blocks := masked.blocks()) == 1:
        worth = _worth(masked.values, tor, last_ratings, elapsed)
    else:
        worth = reduce(
            operator.add,
            (
                _worth(masked.values[some], tor[some], last_ratings[some], None if elapsed is None else elapsed[some])
                for some in blocks
            ),
        )
    return worth * _share(masked.received)


def _worth(values: Array, tor: Array, last_ratings: Array, elapsed: Array | None) -> Array:
    """Return the sum over raters of rho * ToR * f, shape (P, ...)."""
    steady = sinc(values - last_ratings)
    rho = sinc(1.0 - values) * (steady if elapsed is None else steady**elapsed)
    return total(rho * tor[:, None, ...] * values, 0)


def masked_mean(values: Array, mask: Array | None, *, axis: int) -> tuple[Array, Array]:
    """Return the mean of the values inside the mask along an axis, 0 where there are none, and their number.

    A mask of None is true everywhere.
    """
    if mask is None:
        return values.mean(axis=axis), values.shape[axis]
    count = mask.sum(axis=axis, dtype=values.dtype)
    return namespace(values).where(mask, values, 0.0).sum(axis=axis) / (count + _TINY), count


def weighted_mean(values: Array, weights: Array, *, axis: int) -> Array:
    """Return the weighted mean along an axis, and 0 where all weights are 0.

    Args:
        values: Values, finite also where the weight is 0.
        weights: Weights of at least 0, in a shape that broadcasts with the values.
        axis: Axis of the mean.
    """
    return total(weights * values, axis) / (total(weights, axis) + _TINY)


def smooth(value: Array, previous: Array, lam: float, count: Array) -> Array:
    """Return the exponential mean lam * value + (1 - lam) * previous, and the previous value where the count is 0.

    It is computed as a step from the previous value, so that it is exact where the step is 0.

    Args:
        value: Mean of a round, as from `masked_mean`.
        previous: Exponential mean before the round.
        lam: Weight of the newest round.
        count: Number of values in the mean; 0 where there are none.
    """
    return previous + lam * occurred(count) * (value - previous)


def _share(count: Array) -> Array:
    """Return the factor that turns a sum of so many values into a mean, and an empty sum into 0."""
    return 1.0 / (count + _TINY)


def occurred(count: Array) -> Array:
    """Return 1 where a count is above 0 and 0 where it is 0, in the dtype of the count."""
    return count / (count + _TINY)


def sinc(x: Array) -> Array:
    """Return sin(pi x) / (pi x) for x in [0, 1], exactly 1 at x = 0.

    The absolute value keeps the result at or above 0 where float32 rounds pi up, so that sin(pi) < 0.
    """
    xp = namespace(x)
    if is_compiling(x) and x.dtype == xp.float32:
        return _sinc_polynomial(x)
    angle = math.pi * x + _TINY
    return abs(xp.sin(angle) / angle)


def _sinc_polynomial(x: Array) -> Array:
    """Return sinc by arithmetic alone, accurate to the rounding of float32: exactly 1 at x = 0 and 0 at x = 1.

    The formula is (1 - x^2) (1 + x^2 p(x^2)), where p, of degree 4, was fitted to sinc at 200 Chebyshev nodes.
    """
    square = x * x
    p = _SINC[-1]
    for coefficient in reversed(_SINC[:-1]):
        p = p * square + coefficient
    return (1.0 - square) * (1.0 + square * p)


def _like(counts: Array, values: Array) -> Array:
    """Return counts, which may be integers, in the dtype of the values, so that results keep it."""
    return counts if counts.dtype == values.dtype else namespace(counts).astype(counts, values.dtype)


def _check_shapes(ratings: Array, **others: tuple[Array, str]) -> None:
    """Refuse arrays whose shapes do not match that of the ratings; `others` are arrays with their axes."""
    shape = ratings.shape
    needed = {"SP": shape, "S": shape[:1] + shape[2:], "P": shape[1:]}
    for name, (array, axes) in others.items():
        if array.shape != needed[axes]:
            raise ValueError(
                f"{name} has shape {tuple(array.shape)}; with ratings of shape (S, P, ...) = {tuple(shape)} "
                f"it must be ({', '.join(axes)}, ...) = {tuple(needed[axes])}"
            )
