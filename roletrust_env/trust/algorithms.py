"""The three algorithms of Su and Saint-Jore (EWSN 2023, hal-04161463) as pure functions over
arrays.

Axis 0 is the service rater i (of S), axis 1 the service provider j (of P); every further axis is
batch. The functions run on NumPy and on torch alike, change none of their inputs, and follow the
dtype of the ratings.
"""

import math
import operator
from collections.abc import Callable
from functools import reduce
from typing import Annotated, NamedTuple

import numpy as np

from roletrust_env.arrays import Array, device_of, is_compiling, namespace
from roletrust_env.shapes import (
    PairFlags,
    PerAgent,
    PerPair,
    PerProvider,
    PerRater,
    Shape,
)
from roletrust_env.trees import SHARES
from roletrust_env.trust.ratings import PROVIDER, RATER, TINY, Ratings, smooth

_SINC = (-0.64493406, 0.16680776, -0.023938661, 0.0021907927, -0.00012584944)
"""Coefficients of `_sinc_polynomial`, the constant first."""

_ROUNDING = 1e-12  # a gap to a mean in double precision that is smaller is rounding


def rater_trust(ratings: PerPair, mask: PairFlags, *, previous: PerRater, lam: float) -> PerRater:
    """Return the trust of each rater, ToR (Algorithm 1): how near its ratings are to the average
    ratings.

        fbar[j] = mean over the raters i of j of f[i, j]
        QoR[i]  = 1 - mean over the providers j that i rated of sqrt(|f[i, j] - fbar[j]|)
        ToR[i] <- lam * QoR[i] + (1 - lam) * ToR[i]

    Args:
        ratings: Ratings f, shape (S, P, ...), each in [0, 1]. Cells outside the mask are ignored,
            whatever they hold.
        mask: Mask m, shape (S, P, ...), boolean, true where i rated j in this round.
        previous: Trust ToR before the round, shape (S, ...), in [0, 1].
        lam: Weight of the newest round, in [0.5, 1].

    Returns:
        ToR after the round, shape (S, ...), in [0, 1]. A rater without ratings in this round keeps
        its ToR.

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
    played = Ratings(ratings, mask)
    return smooth(rater_quality(played), previous, lam, played.count(RATER))


def provider_trust(
    ratings: PerPair,
    mask: PairFlags,
    *,
    tor: PerRater,
    previous: PerProvider,
    lam: float,
    last_ratings: PerPair,
    elapsed: Annotated[Array, Shape("S P ...", "number")],
) -> PerProvider:
    """Return the trust of each provider, ToP (Algorithm 2): its ratings' level, their steadiness,
    their raters' trust.

        rho[i, j] = sinc(1 - f[i, j]) * sinc(delta[i, j]) ** dt[i, j],
                delta = |f - the last rating that i gave j|
        QoP[j]    = mean over the raters i of j of rho[i, j] * ToR[i] * f[i, j]
        ToP[j]   <- lam * QoP[j] + (1 - lam) * ToP[j]

    Args:
        ratings: Ratings f, shape (S, P, ...), each in [0, 1]. Cells outside the mask are ignored,
            whatever they hold.
        mask: Mask m, shape (S, P, ...), boolean, true where i rated j in this round.
        tor: Trust ToR as just updated by this round, shape (S, ...), in [0, 1].
        previous: Trust ToP before the round, shape (P, ...), in [0, 1].
        lam: Weight of the newest round, in [0.5, 1).
        last_ratings: Last rating that i gave j, shape (S, P, ...); ignored where `elapsed` is 0.
        elapsed: Time dt, in service periods since i last rated j, shape (S, P, ...), and 0 where i
            never did: a first rating has sinc(delta) ** 0 = 1.

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
    played = Ratings(ratings, mask)
    quality = provider_quality(played, tor, last_ratings, _like(elapsed, ratings))
    return smooth(quality, previous, lam, played.count(PROVIDER))


def agent_trust(
    tor: PerAgent,
    top: PerAgent,
    *,
    rated: Annotated[Array, Shape("N ...", "number")],
    provided: Annotated[Array, Shape("N ...", "number")],
    initial: float,
) -> PerAgent:
    """Return the trust of each agent, ToA (Algorithm 3): its two trusts, weighted by how often it
    played each role.

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
    alpha = rated / (total + TINY)
    return namespace(tor).where(total > 0, alpha * tor + (1 - alpha) * top, initial)


class Trusts(NamedTuple):
    """The trust of the raters, shape (S, ...), and of the providers, shape (P, ...)."""

    tor: Annotated[PerRater, SHARES]
    top: Annotated[PerProvider, SHARES]


Root = Callable[[Array], Array]
"""A function in place of the square root."""


def rater_quality(ratings: Ratings, root: Root | None = None) -> PerRater:
    """Return QoR of Algorithm 1, shape (S, ...); 1 for a rater without ratings.

    Args:
        ratings: Ratings of the round.
        root: Function in place of the square root, for callers that need a slope at 0.
    """
    xp = namespace(ratings.values)
    root = root or xp.sqrt
    # Relative to the best rating, raters who agree are exactly 0 from the average; sqrt would
    # magnify rounding.
    best = ratings.gather(ratings.reduce(ratings.values, PROVIDER, "max"), PROVIDER)
    blocks = ratings.blocks()
    if len(blocks) == 1:
        below = ratings.weigh(ratings.values - best)
        average = ratings.reduce(below, PROVIDER) * _inverse(ratings.count(PROVIDER))
        return _nearness(ratings, below - ratings.gather(average, PROVIDER), root)
    parts = [ratings.rows(block) for block in blocks]
    average = reduce(
        operator.add, (part.reduce(part.weigh(part.values - best), PROVIDER) for part in parts)
    )
    average = average * _inverse(ratings.count(PROVIDER))
    return xp.concat(
        [_nearness(part, part.weigh(part.values - best) - average, root) for part in parts]
    )


def _nearness(ratings: Ratings, apart: Array, root: Root) -> Array:
    """Return 1 minus the mean root of the distances of each rater's ratings to the average
    ratings.
    """
    distance = ratings.reduce(ratings.weigh(root(without_rounding(abs(apart)))), RATER)
    return 1.0 - distance * _inverse(ratings.count(RATER))


def without_rounding(gap: Array) -> Array:
    """Return the gaps, and 0 for those below 1e-12: the order of a sum decides over them, and a
    root magnifies them.
    """
    return namespace(gap).where(gap < _ROUNDING, 0.0, gap)


def provider_quality(
    ratings: Ratings, tor: PerRater, last_ratings: Array, elapsed: Array | None
) -> PerProvider:
    """Return QoP of Algorithm 2, shape (P, ...); 0 for a provider without ratings.

    Args:
        ratings: Ratings of the round.
        tor: Trust ToR as just updated by this round, shape (S, ...).
        last_ratings: Last rating that i gave j, for each cell of the round.
        elapsed: Time dt for each cell of the round, see `provider_trust`; None where it is 1
            everywhere.
    """
    if len(blocks := ratings.blocks()) == 1:
        worth = _worth(ratings, tor, last_ratings, elapsed)
    else:
        worth = reduce(
            operator.add,
            (
                _worth(
                    ratings.rows(rows),
                    tor[rows],
                    last_ratings[rows],
                    None if elapsed is None else elapsed[rows],
                )
                for rows in blocks
            ),
        )
    return worth * _inverse(ratings.count(PROVIDER))


def _worth(ratings: Ratings, tor: Array, last_ratings: Array, elapsed: Array | None) -> Array:
    """Return the sum over raters of rho * ToR * f, shape (P, ...)."""
    steady = sinc(ratings.values - last_ratings)
    rho = sinc(1.0 - ratings.values) * (steady if elapsed is None else steady**elapsed)
    return ratings.reduce(rho * ratings.gather(tor, RATER) * ratings.values, PROVIDER)


def _inverse(count: Array) -> Array:
    """Return the factor that turns a sum of so many values into a mean, and an empty sum into 0."""
    return 1.0 / (count + TINY)


def safe_power(base: Array, exponent: float) -> Array:
    """Return numbers of at least 0 to a power, with slope 0 at 0, where a power below 1 is
    infinitely steep.
    """
    xp, zero = namespace(base), base == 0
    return xp.where(zero, 0.0**exponent, xp.where(zero, 1.0, base) ** exponent)


def upper_median(values: Array, present: Array) -> Array:
    """Return the upper median along the first axis of the values that are there; 0 of fewer than
    two.
    """
    xp = namespace(values)
    count = xp.sum(present, axis=0)
    if isinstance(values, np.ndarray) and values.ndim == 1:  # no sort is needed
        middle = int(count) // 2
        return np.partition(values[present], middle)[middle] if count > 1 else np.zeros(())
    ordered = xp.sort(xp.where(present, values, float("inf")), axis=0)
    place = xp.arange(len(values), device=device_of(values)).reshape(-1, *[1] * (values.ndim - 1))
    return xp.where(count > 1, xp.where(place == count // 2, ordered, 0.0).sum(axis=0), 0.0)


def sinc(x: Array) -> Array:
    """Return sin(pi x) / (pi x) for x in [0, 1], exactly 1 at x = 0.

    The absolute value keeps the result at or above 0 where float32 rounds pi up, so that sin(pi) <
    0.
    """
    xp = namespace(x)
    if is_compiling(x) and x.dtype == xp.float32:
        return _sinc_polynomial(x)
    angle = math.pi * x + TINY
    return abs(xp.sin(angle) / angle)


def _sinc_polynomial(x: Array) -> Array:
    """Return sinc by arithmetic alone, accurate to the rounding of float32: exactly 1 at x = 0 and
    0 at x = 1.

    The formula is (1 - x^2) (1 + x^2 p(x^2)), where p, of degree 4, was fitted to sinc at 200
    Chebyshev nodes.
    """
    square = x * x
    p = _SINC[-1]
    for coefficient in reversed(_SINC[:-1]):
        p = p * square + coefficient
    return (1.0 - square) * (1.0 + square * p)


def _like(counts: Array, values: Array) -> Array:
    """Return counts, which may be integers, in the dtype of the values, so that results keep it."""
    return (
        counts if counts.dtype == values.dtype else namespace(counts).astype(counts, values.dtype)
    )


def _check_shapes(ratings: Array, **others: tuple[Array, str]) -> None:
    """Refuse arrays whose shapes do not match that of the ratings; `others` are arrays with their
    axes.
    """
    shape = ratings.shape
    needed = {"SP": shape, "S": shape[:1] + shape[2:], "P": shape[1:]}
    for name, (array, axes) in others.items():
        if array.shape != needed[axes]:
            raise ValueError(
                f"{name} has shape {tuple(array.shape)}; with ratings of shape (S, P, ...) = "
                f"{tuple(shape)} "
                f"it must be ({', '.join(axes)}, ...) = {tuple(needed[axes])}"
            )
